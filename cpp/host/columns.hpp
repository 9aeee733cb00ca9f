/// The columns of one effect for a block of samples, and what a design remembers between blocks.
///
/// The formulas are those of the effects; only the order of the loops differs. A test holds
/// columns to the bits of the plain rows.
#pragma once

#include <algorithm>
#include <limits>
#include <type_traits>
#include <variant>
#include <vector>

#include "flexspline/effects/catalogue.hpp"
#include "flexspline/model.hpp"
#include "host/stateful_columns.hpp"

namespace flexspline::batch {

inline constexpr std::size_t max_harmonics = 64;  ///< of one effect

using AnyEffect = Catalogue<std::variant, double, max_harmonics>;

template <typename... Effects>
using StateOfOne = std::variant<StateOf<Effects>...>;

/// The memory of any effect, by the place of the effect in the catalogue.
using AnyState = Catalogue<StateOfOne, double, max_harmonics>;

/// The memory of a design: one for each of its effects; empty where none of them remembers.
using Memory = std::vector<AnyState>;

/// The place of an effect in the catalogue.
template <typename Effect, typename... All>
constexpr std::size_t place_in(std::type_identity<std::variant<All...>>) {
  std::size_t place = 0;
  (void)((std::is_same_v<Effect, All> || (++place, false)) || ...);
  return place;
}
template <typename Effect>
inline constexpr std::size_t place_of = place_in<Effect>(std::type_identity<AnyEffect>{});

/// How many terms the effect has.
inline std::size_t terms_of(const AnyEffect& any) {
  return std::visit(
      [](const auto& effect) {
        if constexpr (HarmonicEffect<std::remove_cvref_t<decltype(effect)>>) {
          return 2 * effect.harmonics().size();
        } else {
          return effect.terms.size();
        }
      },
      any);
}

inline bool reads_any(const AnyEffect& any, Channel channel) {
  return std::visit([&](const auto& e) { return reads<std::remove_cvref_t<decltype(e)>>(channel); },
                    any);
}

inline bool carries_load(const AnyEffect& any) {
  return std::visit([](const auto& e) { return CarriesLoad<std::remove_cvref_t<decltype(e)>>; },
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

/// The columns of effects of one kind with memory, which moves on by the block: those of number n
/// from out + n · width · stride on; NaN in rows that cannot be read.
template <Remembers Effect>
void columns(std::span<const StatefulColumn<Effect>> stateful, const SampleBlock& block,
             double* out, std::size_t stride) {
  constexpr std::size_t width = width_of<double, Effect>;
  for (std::size_t k = 0; k < width * stateful.size(); ++k) {
    std::fill_n(out + k * stride, block.size, std::numeric_limits<double>::quiet_NaN());
  }
  step_through(
      stateful, block,
      [out, stride](std::size_t n, std::size_t i, const Row<double, width>& row, const auto&) {
        for (std::size_t k = 0; k < width; ++k) out[(n * width + k) * stride + i] = row[k];
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

/// What speed makes of harmonics, in place.
template <ModulatedHarmonicEffect Effect>
void modulate(const Effect& effect, const SampleBlock& block, double* out, std::size_t stride) {
  for (std::size_t k = 0; k < effect.harmonics().size(); ++k) {
    double* cosine = out + 2 * k * stride;
    double* sine = cosine + stride;
    const std::uint32_t order = effect.harmonics()[k].order;
    run_wide([&effect, cosine, sine, order, v = block.column<Channel::output_velocity>(),
              size = block.size] {
      for (std::size_t i = 0; i < size; ++i) {
        const auto p = effect.modulated({cosine[i], sine[i]}, order, v[i]);
        cosine[i] = p.cosine;
        sine[i] = p.sine;
      }
    });
  }
}

/// The same for harmonics, a harmonic at a time instead of a sample at a time.
template <HarmonicEffect Effect>
void columns(const Effect& effect, const SampleBlock& block, double* out, std::size_t stride) {
  for (std::size_t k = 0; k < effect.harmonics().size(); ++k) {
    const auto [order, pair] = effect.harmonics()[k];
    const Recurrence recurrence = effect.recurrences()[k];
    double* cosine = out + 2 * k * stride;
    double* sine = cosine + stride;
    if (recurrence.steps == 1) {
      phasors(order, block.phases(pair), block.size, cosine, sine);
      continue;
    }
    const double* from = out + 2 * recurrence.from * stride;
    const double* by = out + 2 * recurrence.by * stride;
    run_wide([=, size = block.size] {
      for (std::size_t i = 0; i < size; ++i) {
        const auto p = math::rotate<double>({from[i], from[stride + i]}, {by[i], by[stride + i]});
        cosine[i] = p.cosine;
        sine[i] = p.sine;
      }
    });
  }
  if constexpr (ModulatedHarmonicEffect<Effect>) modulate(effect, block, out, stride);
}

/// The torque of one effect in each row of its columns, term by term as `weighted`.
inline void weigh(std::span<const double> coefficients, const double* columns, std::size_t stride,
                  std::size_t count, double* torque) {
  std::fill_n(torque, count, -0.0);  // −0 + x is x, bit by bit
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    run_wide([column = columns + k * stride, count, c = coefficients[k], torque] {
      for (std::size_t i = 0; i < count; ++i) torque[i] += column[i] * c;
    });
  }
}

}  // namespace flexspline::batch
