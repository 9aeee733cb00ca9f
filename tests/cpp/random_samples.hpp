/// Samples and effects for tests that hold for all of them.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <tuple>

#include "flexspline/effects/catalogue.hpp"
#include "flexspline/model.hpp"

namespace flexspline {

inline constexpr std::size_t room = 12;  ///< harmonics of each ripple effect in the tests

template <typename S>
using AllEffects = Catalogue<std::tuple, S, room>;

/// Calls use(effect) with every effect of the catalogue; ripple effects have mixed orders.
template <typename S, typename Use>
void for_each_effect(Use&& use) {
  AllEffects<S> all;
  std::apply(
      [&](auto&... effect) {
        const auto prepare = [&](auto& e) {
          if constexpr (HarmonicEffect<std::remove_cvref_t<decltype(e)>>) {
            constexpr std::array<std::uint32_t, room> orders{1, 2, 3, 4,  5,   6,
                                                             7, 8, 9, 10, 320, 4200};
            std::array<Harmonic, room> harmonics;
            for (std::size_t k = 0; k < room; ++k) {
              harmonics[k] = {orders[k], e.pairs[k / 3 % e.pairs.size()]};
            }
            e.assign(harmonics);
          }
          use(std::as_const(e));
        };
        (prepare(effect), ...);
      },
      all);
}

/// The row of an effect at the second sample of its run.
template <typename S, typename Effect>
auto second_row(const Effect& effect, const Sample<S>& first, const Sample<S>& at) {
  StateOf<Effect> state;
  (void)row_of<S>(effect, first, state);
  return row_of<S>(effect, at, state);
}

/// Random bits of an angle whose turns are counted.
template <typename S>
Angle<S> any_angle(std::mt19937_64& random) {
  const std::int32_t turns = static_cast<std::int32_t>(random()) >> 2;
  return {turns, {static_cast<math::Bits<S>>(random())}};
}

/// A sample of which the load alone is not zero.
template <typename S>
Sample<S> loaded(S load) {
  Sample<S> at;
  at.load = load;
  return at;
}

/// A sample as a joint has it.
template <typename S>
Sample<S> usual_sample(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Sample<S> at;
  at.output_position = any_angle<S>(random);
  at.motor_position = any_angle<S>(random);
  at.output_velocity = S(normal(random));
  at.output_acceleration = S(10 * normal(random));
  at.temperature = S(30 + 10 * normal(random));
  at.known_load = S(50 * normal(random));
  at.motor_torque = S(normal(random));
  at.period = S(0.001 + 0.001 * std::abs(normal(random)));
  at.time = S(100 * std::abs(normal(random)));
  at.load = S(50 * normal(random));
  at.wave_generator_on_flexspline = any_angle<S>(random).phase;
  at.wave_generator_on_circular_spline = any_angle<S>(random).phase;
  return at;
}

/// Any finite number of the precision: huge, subnormal, both zeros.
template <typename S>
S any_finite(std::mt19937_64& random) {
  for (;;) {
    const S value = std::bit_cast<S>(static_cast<math::Bits<S>>(random()));
    if (math::is_finite(value)) return value;
  }
}

/// A sample whose channels hold any finite numbers.
template <typename S>
Sample<S> any_sample(std::mt19937_64& random) {
  Sample<S> at = usual_sample<S>(random);
  for (S* field : {&at.output_velocity, &at.output_acceleration, &at.temperature, &at.known_load,
                   &at.motor_torque, &at.load}) {
    *field = any_finite<S>(random);
  }
  return at;
}

/// The same bits; what == does not say of zeros.
template <typename S>
bool same_bits(S a, S b) {
  return std::bit_cast<math::Bits<S>>(a) == std::bit_cast<math::Bits<S>>(b);
}

}  // namespace flexspline
