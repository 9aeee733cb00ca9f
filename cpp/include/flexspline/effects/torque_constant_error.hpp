#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// A motor whose torque constant is not what the drive takes it for.
///
///   τ = c · τ_load
///
/// Its row is the known load alone, never the motor's torque, which is what is explained: friction
/// and inertia come out scaled by the same 1 + c, which no run can tell from their size. Linear in
/// c; needs a known load. Where the target is a current, c is 1 / (Ñ k_t) of the true constant less
/// that of the constant that the load was taken off with.
/// Source: full_range_torque_estimation (2): the drive's torque is taken as known.
template <typename S>
struct TorqueConstantError {
  static constexpr std::string_view name = "torque_constant_error";
  static constexpr std::string_view targets = "M";
  static constexpr std::string_view signature =
      "what the motor gives too much is in proportion to the load";
  static constexpr std::string_view source = "full_range_torque_estimation (2)";
  static constexpr std::array<Term, 1> terms{{{"factor", "1"}}};
  static constexpr std::array<Channel, 1> reads{Channel::load};
  static constexpr Traits traits{.known_load = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::known_load}}};

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept { return {at.known_load}; }
};

}  // namespace flexspline
