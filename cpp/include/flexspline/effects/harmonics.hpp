#pragma once

#include <span>

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Which part turns against which.
enum class Pair : std::uint8_t {
  output_on_housing,
  motor_on_stator,
  wave_generator_on_flexspline,
  wave_generator_on_circular_spline,
};

/// The angle between the two parts.
template <typename S>
constexpr Phase<S> phase_of(Pair pair, const Sample<S>& at) noexcept {
  switch (pair) {
    case Pair::output_on_housing:
      return at.output_position.phase;
    case Pair::motor_on_stator:
      return at.motor_position.phase;
    case Pair::wave_generator_on_flexspline:
      return at.wave_generator_on_flexspline;
    case Pair::wave_generator_on_circular_spline:
      return at.wave_generator_on_circular_spline;
  }
  return {};
}

/// One sinusoid: `order` periods per turn of the pair.
struct Harmonic {
  std::uint32_t order = 1;
  Pair pair = Pair::output_on_housing;
};

/// How a harmonic is reached: by itself, or from two before it, whose angles add up to its own.
struct Recurrence {
  std::uint8_t steps = 1;  ///< 1: by itself; else the steps of the two together
  std::uint8_t from = 0;   ///< place of the one
  std::uint8_t by = 0;     ///< place of the other
};

/// Harmonics of the angle between two parts: two terms an order, cosine then sine.
///
///   row = cos(o₁ β), sin(o₁ β), cos(o₂ β), sin(o₂ β), …
///
/// How they are reached is part of the contract, because it decides the last bits:
///
///   by itself     cosine and sine of o β, whose fraction of a turn is an exact integer
///   by addition   from two before it of the same pair, o = o_i + o_j, i ≤ j:
///                 cos = c_i c_j − s_i s_j,  sin = s_i c_j + c_i s_j
///
/// By addition wherever that takes at most sixteen steps (those of i and j together), by the
/// fewest, of several such by the i that comes last; orders 1 … 16 or 2, 4, … 32 take one cosine
/// and sine in all. Planned once, when the orders are set. Error, absolute: 1.4e-7 a step (float)
/// or 5.4e-16 (double), so k times that for order k of 1, 2, …; an order by itself has one step.
template <typename S, std::size_t K>
class Harmonics {
 public:
  static_assert(K > 0 && K < 256);
  static constexpr std::array<Term, 2> terms{{{"cosine", "Nm"}, {"sine", "Nm"}}};
  static constexpr std::size_t most = K;
  static constexpr int most_steps = 16;

  /// K times order 1.
  constexpr Harmonics() noexcept = default;
  /// The first `count` ≤ K of these.
  constexpr Harmonics(const std::array<Harmonic, K>& harmonics, std::size_t count = K) noexcept {
    assign(std::span(harmonics).first(count));
  }

  /// Replaces all orders by these, at most K.
  constexpr void assign(std::span<const Harmonic> harmonics) noexcept {
    count_ = harmonics.size();
    for (std::size_t k = 0; k < count_; ++k) {
      harmonics_[k] = harmonics[k];
      recurrences_[k] = recurrence_of(k);
    }
  }

  constexpr std::span<const Harmonic> harmonics() const noexcept {
    return std::span(harmonics_).first(count_);
  }
  constexpr std::span<const Recurrence> recurrences() const noexcept {
    return std::span(recurrences_).first(count_);
  }

  /// Harmonic k of the row, where those before it are in `row` already.
  constexpr math::Phasor<S> reach(std::size_t k, const Sample<S>& at,
                                  std::span<const S> row) const noexcept {
    const auto reached = [row](std::size_t i) {
      return math::Phasor<S>{row[2 * i], row[2 * i + 1]};
    };
    const Recurrence recurrence = recurrences_[k];
    return recurrence.steps > 1 ? math::rotate(reached(recurrence.from), reached(recurrence.by))
                                : alone(k, at).phasor();
  }

  constexpr Row<S, 2 * K> row(const Sample<S>& at) const noexcept {
    Row<S, 2 * K> result{};
    for_each_place<K>([&](std::size_t k) {
      if (k >= count_) return;
      const math::Phasor<S> p = reach(k, at, result);
      result[2 * k] = p.cosine;
      result[2 * k + 1] = p.sine;
    });
    return result;
  }

 private:
  constexpr Phase<S> alone(std::size_t k, const Sample<S>& at) const noexcept {
    return math::Bits<S>(harmonics_[k].order) * phase_of(harmonics_[k].pair, at);
  }

  constexpr Recurrence recurrence_of(std::size_t k) const noexcept {
    Recurrence best;
    for (std::size_t i = 0; i < k; ++i) {
      for (std::size_t j = i; j < k; ++j) {
        const int steps = recurrences_[i].steps + recurrences_[j].steps;
        if (!adds_up(i, j, k) || steps > most_steps || (best.steps > 1 && steps > best.steps)) {
          continue;
        }
        best = {static_cast<std::uint8_t>(steps), static_cast<std::uint8_t>(i),
                static_cast<std::uint8_t>(j)};
      }
    }
    return best;
  }

  constexpr bool adds_up(std::size_t i, std::size_t j, std::size_t k) const noexcept {
    const auto& h = harmonics_;
    return h[i].pair == h[k].pair && h[j].pair == h[k].pair &&
           std::uint64_t(h[i].order) + h[j].order == h[k].order;
  }

  std::array<Harmonic, K> harmonics_{};
  std::array<Recurrence, K> recurrences_{};
  std::size_t count_ = K;
};

}  // namespace flexspline
