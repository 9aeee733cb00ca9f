#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// A sensor whose factor is wrong: its error is in proportion to the true torque.
///
///   τ = c · τ_load
///
/// Linear in c; needs a known load.
/// Source: zhang_disturbance_elimination (8), (25).
template <typename S>
struct GainError {
  static constexpr std::string_view name = "gain_error";
  static constexpr std::string_view targets = "S";
  static constexpr std::string_view signature = "the residual is in proportion to the load";
  static constexpr std::string_view source = "zhang_disturbance_elimination (8), (25)";
  static constexpr std::array<Term, 1> terms{{{"gain", "1"}}};
  static constexpr std::array<Channel, 1> reads{Channel::load};
  static constexpr Traits traits{.known_load = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::known_load}}};

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept { return {at.load}; }
};

}  // namespace flexspline
