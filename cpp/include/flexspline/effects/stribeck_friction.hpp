#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// The share of its level that Stribeck's friction still has at a velocity: exp(−(v / v_s)²), at
/// least 2e-22; 1 at v = 0. `stribeck_velocity` > 0, of the same unit.
template <typename S>
constexpr S stribeck_share(S velocity, S stribeck_velocity) noexcept {
  const S slip = velocity / stribeck_velocity;
  return math::exp(math::clamp(-slip * slip, S(-50), S(0)));
}

/// Extra friction that fades as the joint starts to slide (Stribeck).
///
///   τ = c · d(v) · exp(−(v / v_s)²),     d(v) = tanh(v / v_d)
///
/// At v = 0: 0. Far above v_s: 2e-22 c, not less: a product of it that is subnormal is slow on a
/// PC and flushed on some devices. Odd in v. Linear in c.
/// Source: [Olsson1998], Friction models and friction compensation; d as in coulomb_friction.
template <typename S>
struct StribeckFriction {
  static constexpr std::string_view name = "stribeck_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature = "friction falls with speed just above standstill";
  static constexpr std::string_view source =
      "Olsson et al. 1998, Friction models and friction compensation";
  static constexpr std::array<Term, 1> terms{{{"level", "Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_velocity};
  static constexpr Traits traits{.one_signed = true, .dissipative = true};
  static constexpr std::array<Demand, 2> demands{
      {{Excitation::both_directions}, {Excitation::low_speeds}}};

  S stribeck_velocity = S(0.1);  ///< rad/s at the output, > 0
  S direction_width = S(0.005);  ///< rad/s, half-width of the change of direction, > 0; one for all
                                 ///< friction of a model

  static constexpr auto shapes() noexcept {
    return std::array{
        Shape<StribeckFriction, S>{"stribeck_velocity", "rad/s",
                                   &StribeckFriction::stribeck_velocity, S(1e-3), S(10), true},
        direction_width_shape<StribeckFriction, S>()};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {direction(at.output_velocity, direction_width) *
            stribeck_share(at.output_velocity, stribeck_velocity)};
  }
};

}  // namespace flexspline
