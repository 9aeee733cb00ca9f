#pragma once

#include "flexspline/effects/harmonics.hpp"

namespace flexspline {

/// Ripple at low harmonics of the wave generator's angle against the flexspline, where strain
/// gauges sit, or against the circular spline, where the teeth are.
///
///   τ = Σ_k  a_k cos(k β) + b_k sin(k β),     β: θ, θ − q or θ + q (see Gear)
///
/// Linear in a and b. Where it is not known which spline is the output, β is the motor's θ.
/// Source: zhang_disturbance_elimination (2), Fig. 15.
template <typename S, std::size_t K>
struct WaveGeneratorRipple : Harmonics<S, K> {
  static constexpr std::string_view name = "wave_generator_ripple";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "one to four periods per turn of the wave generator";
  static constexpr std::string_view source = "zhang_disturbance_elimination (2), Fig. 15";
  static constexpr std::array<Channel, 1> reads{Channel::motor_position};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::resolved_order, 2}}};
  static constexpr std::array<Pair, 3> pairs{Pair::wave_generator_on_flexspline,
                                             Pair::wave_generator_on_circular_spline,
                                             Pair::motor_on_stator};
};

}  // namespace flexspline
