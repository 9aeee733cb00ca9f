#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Friction in proportion to speed.
///
///   τ = c · v
///
/// Odd in v. Linear in c.
/// Source: turlapati_intrinsic_dynamics (10).
template <typename S>
struct ViscousFriction {
  static constexpr std::string_view name = "viscous_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature = "torque rises in a straight line with speed";
  static constexpr std::string_view source = "turlapati_intrinsic_dynamics (10)";
  static constexpr std::array<Term, 1> terms{{{"viscosity", "Nm·s/rad"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_velocity};
  static constexpr Traits traits{.basic = true, .one_signed = true, .dissipative = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::speed_ratio, 1.5}}};

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept { return {at.output_velocity}; }
};

}  // namespace flexspline
