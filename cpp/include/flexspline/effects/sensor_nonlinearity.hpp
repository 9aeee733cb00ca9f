#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// A sensor whose characteristic is bent.
///
///   τ = c₂ τ_load² + c₃ τ_load³
///
/// Without load: 0, with slope 0; the slope is gain_error. Linear in both. The square makes the
/// two directions of load unequal, the cube bends both alike.
/// Source: the step beyond zhang_disturbance_elimination (25) and its non-linear error, 0.878 %.
template <typename S>
struct SensorNonlinearity {
  static constexpr std::string_view name = "sensor_nonlinearity";
  static constexpr std::string_view targets = "S";
  static constexpr std::string_view signature =
      "the residual over the load is a bow, the same up and down";
  static constexpr std::string_view source = "zhang_disturbance_elimination (25), a step beyond";
  static constexpr std::array<Term, 2> terms{{{"quadratic", "1/Nm"}, {"cubic", "1/Nm²"}}};
  static constexpr std::array<Channel, 1> reads{Channel::load};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::any_load}}};

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    const S square = at.load * at.load;
    return {square, square * at.load};
  }
};

}  // namespace flexspline
