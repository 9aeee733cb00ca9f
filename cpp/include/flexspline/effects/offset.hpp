#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// A constant torque: the sensor's zero, or what its calibration left.
///
///   τ = c
///
/// Linear in c.
/// Source: turlapati_intrinsic_dynamics (14).
template <typename S>
struct Offset {
  static constexpr std::string_view name = "offset";
  static constexpr std::string_view targets = "SMD";
  static constexpr std::string_view signature =
      "the residual's mean is not zero, whatever the joint does";
  static constexpr std::string_view source = "turlapati_intrinsic_dynamics (14)";
  static constexpr std::array<Term, 1> terms{{{"offset", "Nm"}}};
  static constexpr std::array<Channel, 0> reads{};
  static constexpr Traits traits{.constant = true, .basic = true};
  static constexpr std::array<Demand, 0> demands{};

  constexpr Row<S, 1> row(const Sample<S>& /*at*/) const noexcept { return {S(1)}; }
};

}  // namespace flexspline
