#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Friction whose level and viscosity differ between the two directions of motion.
///
///   τ = c · d(v)² + b · |v|,     d(v) = tanh(v / v_d),     |v| as v · d(v)
///
/// c, b: half of what level and viscosity forward exceed those backward by. Beside Coulomb friction
/// C and viscous friction B the joint then brakes with (C + c) + (B + b) v forward and with
/// (C − c) + (B − b) |v| backward. At v = 0: 0. Even in v. Linear in c and b.
/// Source: direction-dependent friction of geared joints, [ArmstrongHelouvry1994], §2.
template <typename S>
struct DirectionDependentFriction {
  static constexpr std::string_view name = "direction_dependent_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "friction is larger in one direction of motion than in the other";
  static constexpr std::string_view source = "Armstrong-Hélouvry et al. 1994, §2";
  static constexpr std::array<Term, 2> terms{{{"level", "Nm"}, {"viscosity", "Nm·s/rad"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_velocity};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 2> demands{
      {{Excitation::both_directions}, {Excitation::speed_ratio, 1.5}}};

  S direction_width = S(0.005);  ///< rad/s, half-width of the change of direction, > 0; one for all
                                 ///< friction of a model

  static constexpr auto shapes() noexcept {
    return std::array{direction_width_shape<DirectionDependentFriction, S>()};
  }

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    const S d = direction(at.output_velocity, direction_width);
    return {d * d, at.output_velocity * d};
  }
};

}  // namespace flexspline
