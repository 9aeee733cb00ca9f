#pragma once

#include "flexspline/effects/harmonics.hpp"

namespace flexspline {

/// Error of the gear itself: teeth and their partners are not where they should be.
///
///   Δθ = Σ_k  a_k cos(o_k β_k) + b_k sin(o_k β_k),     β_k: the angle of any pair of parts
///
/// Linear in a and b [rad at the motor]. The text has all orders in q alone; those near Ñ belong to
/// pairs on the motor side, which differ from Ñ q by the torsion itself.
/// Source: full_range_torque_estimation (12), (23), Table III.
template <typename S, std::size_t K>
struct KinematicError : Harmonics<S, K> {
  static constexpr std::string_view name = "kinematic_error";
  static constexpr std::string_view targets = "D";
  static constexpr std::string_view signature =
      "a pattern of the torsion over the gear's angles, whatever the load";
  static constexpr std::string_view source = "full_range_torque_estimation (12), (23), Table III";
  static constexpr std::array<Term, 2> terms{{{"cosine", "rad"}, {"sine", "rad"}}};
  static constexpr std::array<Channel, 2> reads{Channel::output_position, Channel::motor_position};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::turn, 1}}};
  static constexpr std::array<Pair, 4> pairs{Pair::output_on_housing, Pair::motor_on_stator,
                                             Pair::wave_generator_on_flexspline,
                                             Pair::wave_generator_on_circular_spline};
};

}  // namespace flexspline
