#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Friction of a constant level that opposes motion.
///
///   τ = c · d(v),     d(v) = tanh(v / v_d)
///
/// At v = 0: 0. Far above v_d: ± c. Odd in v. Linear in c.
/// The two sigmoids of (9) are this column and a constant, α = 2 / v_d.
/// Source: turlapati_intrinsic_dynamics (8), (9).
template <typename S>
struct CoulombFriction {
  static constexpr std::string_view name = "coulomb_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "a step in torque where the direction of motion changes";
  static constexpr std::string_view source = "turlapati_intrinsic_dynamics (8), (9)";
  static constexpr std::array<Term, 1> terms{{{"level", "Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_velocity};
  static constexpr Traits traits{.basic = true, .one_signed = true, .dissipative = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::both_directions}}};
  static constexpr std::string_view reversal = "a jump at each reversal";

  S direction_width = S(0.005);  ///< rad/s, half-width of the change of direction, > 0; one for all
                                 ///< friction of a model

  static constexpr auto shapes() noexcept {
    return std::array{direction_width_shape<CoulombFriction, S>()};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {direction(at.output_velocity, direction_width)};
  }
};

}  // namespace flexspline
