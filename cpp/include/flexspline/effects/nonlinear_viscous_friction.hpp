#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// What bends the friction curve at speed.
///
///   τ = c₂ v |v| + c₃ v³
///
/// Odd in v. Linear in c₂ and c₃; the first power is viscous_friction.
/// Source: full_range_torque_estimation (21).
template <typename S>
struct NonlinearViscousFriction {
  static constexpr std::string_view name = "nonlinear_viscous_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature = "torque over speed bends at high speed";
  static constexpr std::string_view source = "full_range_torque_estimation (21)";
  static constexpr std::array<Term, 2> terms{
      {{"quadratic", "Nm·s²/rad²"}, {"cubic", "Nm·s³/rad³"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_velocity};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::speed_ratio, 3}}};

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    const S v = at.output_velocity;
    return {v * math::absolute(v), v * v * v};
  }
};

}  // namespace flexspline
