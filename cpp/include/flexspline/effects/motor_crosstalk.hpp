#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Motor current that leaks into the bridge: through the supply, the ground or a magnetic field.
///
///   τ = c · τ_m
///
/// τ_m stands for the current, which it is in proportion to. At τ_m = 0: 0. Linear in c, Nm read
/// for each Nm at the motor's shaft. The motor follows the load, so that gain_error looks alike
/// unless the joint also accelerates, rubs or is held.
/// Source: none of the papers; coupling between cables, in any book on electronics.
template <typename S>
struct MotorCrosstalk {
  static constexpr std::string_view name = "motor_crosstalk";
  static constexpr std::string_view targets = "S";
  static constexpr std::string_view signature =
      "the residual follows the motor's current, with no load at the output too";
  static constexpr std::string_view source =
      "coupling between cables, as books on electronics have it";
  static constexpr std::array<Term, 1> terms{{{"leakage", "1"}}};
  static constexpr std::array<Channel, 1> reads{Channel::motor_torque};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::motor_torque}}};

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept { return {at.motor_torque}; }
};

}  // namespace flexspline
