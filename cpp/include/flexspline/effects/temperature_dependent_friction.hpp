#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Viscous friction that changes with temperature: grease thins as it warms.
///
///   τ = (c₁ (T − T₀) + c₂ (T − T₀)²) v
///
/// At T₀ and at v = 0: 0. Odd in v. Linear in both. The square is there because viscosity falls
/// like an exponential: over 20 K a straight line misses a tenth of the change.
/// Source: full_range_torque_estimation §I; [Simoni2015], Friction modeling with temperature
/// effects for industrial robot manipulators.
template <typename S>
struct TemperatureDependentFriction {
  static constexpr std::string_view name = "temperature_dependent_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "torque rises less with speed when the joint is warm";
  static constexpr std::string_view source =
      "Simoni et al. 2015, Friction modeling with temperature effects for industrial manipulators";
  static constexpr std::array<Term, 2> terms{
      {{"linear", "Nm·s/(rad·K)"}, {"quadratic", "Nm·s/(rad·K²)"}}};
  static constexpr std::array<Channel, 2> reads{Channel::output_velocity, Channel::temperature};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 2> demands{
      {{Excitation::temperature, 2}, {Excitation::speed_ratio, 1.5}}};

  S reference_temperature = S(25);  ///< °C, where viscous_friction holds alone

  static constexpr auto shapes() noexcept {
    return std::array{reference_temperature_shape<TemperatureDependentFriction, S>()};
  }

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    const S warmer = at.temperature - reference_temperature;
    const S linear = at.output_velocity * warmer;
    return {linear, linear * warmer};
  }
};

}  // namespace flexspline
