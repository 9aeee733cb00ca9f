#pragma once

#include "flexspline/row.hpp"

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

/// Harmonics of the angle between two parts: two terms an order, cosine then sine.
///
///   row = cos(o₁ β), sin(o₁ β), cos(o₂ β), sin(o₂ β), …
///
/// How they are reached is part of the contract, because it decides the last bits: in groups
/// of eight, an order that follows its neighbour by one on the same pair is the neighbour
/// turned by one angle; every other order is evaluated by itself. `count` ≤ K are used.
template <typename S, std::size_t K>
struct Harmonics {
  static constexpr std::array<Term, 2> terms{{{"cosine", "Nm"}, {"sine", "Nm"}}};
  static constexpr std::size_t group = 8;

  std::array<Harmonic, K> harmonics{};
  std::size_t count = K;

  /// True where harmonic k is its predecessor turned by one angle.
  constexpr bool continues(std::size_t k) const noexcept {
    return k % group != 0 && harmonics[k].pair == harmonics[k - 1].pair &&
           harmonics[k].order == harmonics[k - 1].order + 1;
  }

  constexpr Row<S, 2 * K> row(const Sample<S>& at) const noexcept {
    Row<S, 2 * K> result{};
    math::Phasor<S> p{};
    math::Phasor<S> once{};
    for (std::size_t k = 0; k < count; ++k) {
      const Phase<S> angle = phase_of(harmonics[k].pair, at);
      if (continues(k)) {
        if (!continues(k - 1)) once = angle.phasor();
        p = math::rotate(p, once);
      } else {
        p = (math::Bits<S>(harmonics[k].order) * angle).phasor();
      }
      result[2 * k] = p.cosine;
      result[2 * k + 1] = p.sine;
    }
    return result;
  }
};

}  // namespace flexspline
