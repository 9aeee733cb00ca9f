#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Coulomb friction whose level grows with the torque that the gear transmits.
///
///   τ = c · |τ_load| · d(v),     d(v) = tanh(v / v_d)
///
/// At v = 0: 0. Without load: 0. Odd in v. Linear in c.
/// Source: full_range_torque_estimation §I and its refs. 7, 8, [Madsen2020] and [Graabaek2024].
template <typename S>
struct LoadDependentFriction {
  static constexpr std::string_view name = "load_dependent_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "the step at a reversal is higher where the joint carries more";
  static constexpr std::string_view source =
      "Madsen et al. 2020, Comprehensive modeling and identification of nonlinear joint dynamics";
  static constexpr std::array<Term, 1> terms{{{"factor", "1"}}};
  static constexpr std::array<Channel, 2> reads{Channel::output_velocity, Channel::load};
  static constexpr Traits traits{.one_signed = true, .dissipative = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::both_directions}}};

  S direction_width = S(0.005);  ///< rad/s, half-width of the change of direction, > 0; one for all
                                 ///< friction of a model

  static constexpr auto shapes() noexcept {
    return std::array{direction_width_shape<LoadDependentFriction, S>()};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {math::absolute(at.load) * direction(at.output_velocity, direction_width)};
  }
};

}  // namespace flexspline
