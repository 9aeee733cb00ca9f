#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Torque in proportion to acceleration.
///
///   τ = c · q̈
///
/// Linear in c. Part of the load that the gear transmits.
/// Source: turlapati_intrinsic_dynamics (11).
template <typename S>
struct Inertia {
  static constexpr std::string_view name = "inertia";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature = "the residual follows acceleration";
  static constexpr std::string_view source = "turlapati_intrinsic_dynamics (11)";
  static constexpr std::array<Term, 1> terms{{{"inertia", "kg·m²"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_acceleration};
  static constexpr Traits traits{
      .basic = true, .inertial = true, .carries_load = true, .one_signed = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::acceleration}}};

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept { return {at.output_acceleration}; }
};

}  // namespace flexspline
