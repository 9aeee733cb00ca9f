#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Drift of the sensor's zero with temperature.
///
///   τ = c₁ (T − T₀) + c₂ (T − T₀)²
///
/// At T₀: 0. Linear in both; the constant of (9) is the offset.
/// Source: zhang_disturbance_elimination (8)–(11).
template <typename S>
struct TemperatureDrift {
  static constexpr std::string_view name = "temperature_drift";
  static constexpr std::string_view targets = "SD";
  static constexpr std::string_view signature =
      "the residual follows temperature, at standstill too";
  static constexpr std::string_view source = "zhang_disturbance_elimination (8)-(11)";
  static constexpr std::array<Term, 2> terms{{{"linear", "Nm/K"}, {"quadratic", "Nm/K²"}}};
  static constexpr std::array<Channel, 1> reads{Channel::temperature};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::temperature, 2}}};

  S reference_temperature = S(25);  ///< °C, where the drift is counted from

  static constexpr auto shapes() noexcept {
    return std::array{reference_temperature_shape<TemperatureDrift, S>()};
  }

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    const S warmer = at.temperature - reference_temperature;
    return {warmer, warmer * warmer};
  }
};

}  // namespace flexspline
