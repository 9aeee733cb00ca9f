/// Effects chosen at run time: their columns for a block of samples, and their sum.
///
/// The formulas are those of the effects; only the order of the loops differs. A test holds
/// columns and sums to the bits of the plain rows.
#pragma once

#include <algorithm>
#include <span>
#include <variant>
#include <vector>

#include "flexspline/batch/samples.hpp"
#include "flexspline/batch/wide_loop.hpp"
#include "flexspline/effects/catalogue.hpp"
#include "flexspline/model.hpp"

namespace flexspline::batch {

inline constexpr std::size_t max_harmonics = 64;  ///< of one effect

using AnyEffect = Catalogue<std::variant, double, max_harmonics>;

/// How many terms the effect has.
inline std::size_t terms_of(const AnyEffect& any) {
  return std::visit(
      [](const auto& effect) {
        if constexpr (HarmonicEffect<std::remove_cvref_t<decltype(effect)>>) {
          return 2 * effect.count;
        } else {
          return effect.terms.size();
        }
      },
      any);
}

/// The columns of one effect for a block: term k of sample i at out[k · stride + i].
template <typename Effect>
void columns(const Effect& effect, const SampleBlock& block, double* out, std::size_t stride) {
  constexpr std::size_t width = width_of<double, Effect>;
  run_wide([&effect, &block, out, stride, size = block.size] {
    for (std::size_t i = 0; i < size; ++i) {
      const auto row = effect.row(block[i]);
      for (std::size_t k = 0; k < width; ++k) out[k * stride + i] = row[k];
    }
  });
}

/// Cosine and sine of `order` times the angle of a pair.
inline void phasors(std::uint64_t order, const std::uint64_t* phase, std::size_t size,
                    double* cosine, double* sine) {
  run_wide([=] {
    for (std::size_t i = 0; i < size; ++i) {
      const auto p = (order * Phase<double>{phase[i]}).phasor();
      cosine[i] = p.cosine;
      sine[i] = p.sine;
    }
  });
}

/// The same for harmonics, a harmonic at a time instead of a sample at a time.
template <HarmonicEffect Effect>
void columns(const Effect& effect, const SampleBlock& block, double* out, std::size_t stride) {
  SampleBlock::Column<double> cosine_once;
  SampleBlock::Column<double> sine_once;
  for (std::size_t k = 0; k < effect.count; ++k) {
    const auto [order, pair] = effect.harmonics[k];
    double* cosine = out + 2 * k * stride;
    double* sine = cosine + stride;
    if (!effect.continues(k)) {
      phasors(order, block.phases(pair), block.size, cosine, sine);
      continue;
    }
    if (!effect.continues(k - 1)) {
      phasors(1, block.phases(pair), block.size, cosine_once.data(), sine_once.data());
    }
    const double* last_cosine = cosine - 2 * stride;
    const double* last_sine = sine - 2 * stride;
    run_wide([=, c = cosine_once.data(), s = sine_once.data(), size = block.size] {
      for (std::size_t i = 0; i < size; ++i) {
        const auto p = math::rotate<double>({last_cosine[i], last_sine[i]}, {c[i], s[i]});
        cosine[i] = p.cosine;
        sine[i] = p.sine;
      }
    });
  }
}

/// A model put together at run time.
class Design {
 public:
  Design(std::vector<AnyEffect> effects, const Gear<double>& gear)
      : effects_(std::move(effects)), gear_(gear) {
    for (const AnyEffect& effect : effects_) {
      columns_ += terms_of(effect);
      const bool motor_side = reads_any(effect, Channel::motor_position);
      const bool angle = motor_side || reads_any(effect, Channel::output_position);
      if (angle) ++angle_readers_;
      if (angle && angles_ == SampleBlock::Angles::none) angles_ = SampleBlock::Angles::output;
      if (motor_side) angles_ = SampleBlock::Angles::both_sides;
      load_ |= reads_any(effect, Channel::load);
    }
  }

  std::size_t columns() const noexcept { return columns_; }
  const std::vector<AnyEffect>& effects() const noexcept { return effects_; }
  const Gear<double>& gear() const noexcept { return gear_; }

  /// The columns of rows [first, first + count), count ≤ SampleBlock::capacity: term k of row
  /// first + i at out[k · stride + i]. The load is the known load plus what `coefficients` (as
  /// many as columns, or none) say of it.
  void fill(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, double* out, std::size_t stride) const {
    SampleBlock block;
    SampleBlock::Column<double> load;
    read(channels, first, count, coefficients, out, stride, angles_, block, load);
    each(block, out, stride, [](const AnyEffect&) { return true; });
  }

  /// The same without the columns of ones and of one ripple effect, and instead cosine and sine
  /// of its angle: where no other effect reads an angle, straight from the radians.
  void fill_dense(const Channels& channels, std::size_t first, std::size_t count,
                  std::span<const double> coefficients, std::size_t ripple, double* out,
                  std::size_t stride, double* cosine, double* sine) const {
    const AnyEffect* left_out = &effects_[ripple];
    const Pair pair = pair_of(*left_out);
    const bool direct = angle_readers_ == 1 && pair == Pair::output_on_housing &&
                        channels.output_position != nullptr &&
                        within_reach(channels.output_position + first, count);
    SampleBlock block;
    SampleBlock::Column<double> load;
    read(channels, first, count, coefficients, out, stride,
         direct ? SampleBlock::Angles::none : angles_, block, load);
    each(block, out, stride, [&](const AnyEffect& effect) {
      return &effect != left_out && !std::holds_alternative<Offset<double>>(effect);
    });
    if (direct) {
      kernels().cosine_and_sine(channels.output_position + first, count, cosine, sine);
    } else {
      phasors(1, block.phases(pair), count, cosine, sine);
    }
  }

  /// Row · coefficients for rows [first, first + count), summed as Model::predict does.
  void predict(const Channels& channels, std::size_t first, std::size_t count,
               std::span<const double> coefficients, double* torque) const {
    std::vector<double> rows(columns_ * count);
    fill(channels, first, count, coefficients, rows.data(), count);
    std::fill_n(torque, count, 0.0);
    sum(coefficients, rows.data(), count, count, torque, [](const AnyEffect&) { return true; });
  }

 private:
  static bool reads_any(const AnyEffect& any, Channel channel) {
    return std::visit(
        [&](const auto& e) { return reads<std::remove_cvref_t<decltype(e)>>(channel); }, any);
  }
  static bool carries_load(const AnyEffect& any) {
    return std::visit([](const auto& e) { return CarriesLoad<std::remove_cvref_t<decltype(e)>>; },
                      any);
  }

  /// The pair of a ripple effect's first harmonic.
  static Pair pair_of(const AnyEffect& any) {
    return std::visit(
        [](const auto& effect) {
          if constexpr (HarmonicEffect<std::remove_cvref_t<decltype(effect)>>) {
            return effect.harmonics[0].pair;
          }
          return Pair{};
        },
        any);
  }

  /// Whether angles [rad] are such that the kernel takes them as they are, without phases.
  static bool within_reach(const double* angle, std::size_t count) {
    double farthest = 0.0;
    run_wide([angle, count, &farthest] {
      double most = 0.0;
      for (std::size_t i = 0; i < count; ++i) {
        const double size = math::absolute(angle[i]);
        most = size < most ? most : size;
      }
      farthest = most;
    });
    return farthest <= 1e6;  // false for NaN too
  }

  /// Reads a block and makes its load, kept in `load`; `out` serves as scratch.
  void read(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, double* out, std::size_t stride,
            SampleBlock::Angles angles, SampleBlock& block,
            SampleBlock::Column<double>& load) const {
    block.read(channels, first, count, gear_, angles);
    if (!load_ || coefficients.empty()) return;
    each(block, out, stride, carries_load);
    SampleBlock::Column<double> carried{};
    sum(coefficients, out, stride, count, carried.data(), carries_load);
    for (std::size_t i = 0; i < count; ++i) load[i] = block.known_load[i] + carried[i];
    block.load = load.data();
  }

  template <typename Chosen>
  void each(const SampleBlock& block, double* out, std::size_t stride, Chosen chosen) const {
    for (const AnyEffect& any : effects_) {
      if (chosen(any)) {
        std::visit([&](const auto& e) { flexspline::batch::columns(e, block, out, stride); }, any);
      }
      out += terms_of(any) * stride;
    }
  }

  /// Adds the chosen effects' torques to `total`, an effect at a time.
  template <typename Chosen>
  void sum(std::span<const double> coefficients, const double* rows, std::size_t stride,
           std::size_t count, double* total, Chosen chosen) const {
    SampleBlock::Column<double> torque;
    const double* coefficient = coefficients.data();
    for (const AnyEffect& any : effects_) {
      const std::size_t terms = terms_of(any);
      if (chosen(any)) {
        std::fill_n(torque.begin(), count, 0.0);
        for (std::size_t k = 0; k < terms; ++k) {
          const double* column = rows + k * stride;
          run_wide([column, count, c = coefficient[k], to = torque.data()] {
            for (std::size_t i = 0; i < count; ++i) to[i] += column[i] * c;
          });
        }
        for (std::size_t i = 0; i < count; ++i) total[i] += torque[i];
      }
      rows += terms * stride;
      coefficient += terms;
    }
  }

  std::vector<AnyEffect> effects_;
  Gear<double> gear_;
  std::size_t columns_ = 0;
  SampleBlock::Angles angles_ = SampleBlock::Angles::none;
  std::size_t angle_readers_ = 0;
  bool load_ = false;
};

}  // namespace flexspline::batch
