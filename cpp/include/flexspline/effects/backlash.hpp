#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// A dead zone between the two directions of torque: parts that lie against each other on one side
/// or the other.
///
///   Δθ = −c · tanh(τ / w)
///
/// At τ = 0: 0, in the middle. Far above w: ∓c. Odd in τ. Linear in c, half the dead zone, ≥ 0:
/// outward torque lets the motor run ahead, as for mesh_compliance. w: the torque that brings the
/// parts to lie fully against each other.
/// Source: [NordinGutman2002], Controlling mechanical systems with backlash, a survey.
template <typename S>
struct Backlash {
  static constexpr std::string_view name = "backlash";
  static constexpr std::string_view targets = "D";
  static constexpr std::string_view signature = "the torsion jumps where the load changes its sign";
  static constexpr std::string_view source =
      "Nordin and Gutman 2002, Controlling mechanical systems with backlash";
  static constexpr std::array<Term, 1> terms{{{"half_gap", "rad"}}};
  static constexpr std::array<Channel, 1> reads{Channel::load};
  static constexpr Traits traits{.one_signed = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::both_torques}}};

  S contact_torque = S(0.5);  ///< w, Nm at the output, > 0

  static constexpr auto shapes() noexcept {
    return std::array{Shape<Backlash, S>{"contact_torque", "Nm", &Backlash::contact_torque, S(0.01),
                                         S(100), true}};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {-math::tanh(at.load / contact_torque)};
  }
};

}  // namespace flexspline
