#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// A sensor whose factor changes with temperature: the modulus of its steel and the gauges' factor
/// do.
///
///   τ = c · τ_load (T − T₀)
///
/// Without load and at T₀: 0. Linear in c; steel with common gauges: 3e-4 /K to 6e-4 /K.
/// Source: zhang_disturbance_elimination (8), whose sensitivity holds at one temperature.
template <typename S>
struct GainTemperatureDependence {
  static constexpr std::string_view name = "gain_temperature_dependence";
  static constexpr std::string_view targets = "S";
  static constexpr std::string_view signature =
      "the residual is in proportion to the load, by another factor when warm";
  static constexpr std::string_view source = "zhang_disturbance_elimination (8), a step beyond";
  static constexpr std::array<Term, 1> terms{{{"gain", "1/K"}}};
  static constexpr std::array<Channel, 2> reads{Channel::load, Channel::temperature};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 2> demands{
      {{Excitation::any_load}, {Excitation::temperature, 2}}};

  S reference_temperature = S(25);  ///< °C, where gain_error holds alone

  static constexpr auto shapes() noexcept {
    return std::array{reference_temperature_shape<GainTemperatureDependence, S>()};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {at.load * (at.temperature - reference_temperature)};
  }
};

}  // namespace flexspline
