#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/gear_compliance.hpp"

namespace flexspline {

/// A tooth mesh that gives way more, or less, when it is warm.
///
///   Δθ = −c (T − T₀) · atan(c_m τ) / c_m
///
/// At T₀ and at τ = 0: 0. Odd in τ. Linear in c, the change of mesh_compliance for each kelvin; one
/// c_m for both. Steel alone: 3e-4 of the compliance for each kelvin; grease and fits more.
/// Source: full_range_torque_estimation (15), whose stiffness holds at one temperature.
template <typename S>
struct TemperatureDependentStiffness {
  static constexpr std::string_view name = "temperature_dependent_stiffness";
  static constexpr std::string_view targets = "D";
  static constexpr std::string_view signature =
      "the torsion follows the load, by another factor when warm";
  static constexpr std::string_view source = "full_range_torque_estimation (15), a step beyond";
  static constexpr std::array<Term, 1> terms{{{"compliance", "rad/(Nm·K)"}}};
  static constexpr std::array<Channel, 2> reads{Channel::load, Channel::temperature};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 2> demands{
      {{Excitation::known_load}, {Excitation::temperature, 2}}};

  S mesh_shape = S(0.05);           ///< c_m, 1/Nm at the output, > 0; one with mesh_compliance
  S reference_temperature = S(25);  ///< °C, where mesh_compliance holds alone

  static constexpr auto shapes() noexcept {
    return std::array{Shape<TemperatureDependentStiffness, S>{
                          "mesh_shape", "1/Nm", &TemperatureDependentStiffness::mesh_shape, S(1e-4),
                          S(10), true, "mesh_compliance"},
                      reference_temperature_shape<TemperatureDependentStiffness, S>()};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {mesh_torsion(at.load, S(1), mesh_shape) * (at.temperature - reference_temperature)};
  }
};

}  // namespace flexspline
