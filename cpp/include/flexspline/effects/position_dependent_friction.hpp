#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Coulomb friction whose level varies with the joint angle: parts that are not round or not
/// aligned press harder in some places.
///
///   τ = d(v) Σ_k  a_k cos(k q) + b_k sin(k q),     k = 1, 2, 3,     d(v) = tanh(v / v_d)
///
/// At v = 0: 0. Odd in v, so that it takes work in both directions as long as coulomb_friction is
/// larger. Linear in a and b. Ripple is the same in both directions; this turns its sign.
/// Source: [ArmstrongHelouvry1991], Control of machines with friction; d as in coulomb_friction.
template <typename S>
struct PositionDependentFriction {
  static constexpr std::string_view name = "position_dependent_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "a pattern over the joint angle that changes its sign with the direction";
  static constexpr std::string_view source =
      "Armstrong-Hélouvry 1991, Control of machines with friction";
  static constexpr std::array<Term, 6> terms{{{"cosine 1", "Nm"},
                                              {"sine 1", "Nm"},
                                              {"cosine 2", "Nm"},
                                              {"sine 2", "Nm"},
                                              {"cosine 3", "Nm"},
                                              {"sine 3", "Nm"}}};
  static constexpr std::array<Channel, 2> reads{Channel::output_position, Channel::output_velocity};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::both_directions}}};

  S direction_width = S(0.005);  ///< rad/s, half-width of the change of direction, > 0; one for all
                                 ///< friction of a model

  static constexpr auto shapes() noexcept {
    return std::array{direction_width_shape<PositionDependentFriction, S>()};
  }

  constexpr Row<S, 6> row(const Sample<S>& at) const noexcept {
    const S d = direction(at.output_velocity, direction_width);
    const math::Phasor<S> one = at.output_position.phase.phasor();
    const math::Phasor<S> two = math::rotate(one, one);
    const math::Phasor<S> three = math::rotate(two, one);
    return {d * one.cosine, d * one.sine,     d * two.cosine,
            d * two.sine,   d * three.cosine, d * three.sine};
  }
};

}  // namespace flexspline
