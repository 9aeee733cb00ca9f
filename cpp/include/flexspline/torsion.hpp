/// The mesh's share of the torsion, from two encoders.
///
///   Δθ_m = (q Ñ − θ − rest) / Ñ       rad at the output
///
/// `rest` is what the model's torsion part says without the mesh: kinematic error, wave generator,
/// the encoders' zeros. q Ñ is taken in whole turns and a fraction, so that a far turn costs a
/// float no digits, and the difference the short way: right while the mesh twists by less than half
/// a turn of the motor side, whatever whole turns lie between the encoders' zeros.
/// Source: full_range_torque_estimation (11), (14); (11) should read Δθ = q Ñ − θ = θ_c Ñ − θ_w.
#pragma once

#include "flexspline/gear.hpp"

namespace flexspline {

/// `rest`: finite, rad at the motor side.
template <typename S>
constexpr S mesh_torsion_left(const Gear<S>& gear, S effective_ratio, const Angle<S>& q,
                              Phase<S> theta, S rest) noexcept {
  const Phase<S> known = Angle<S>::from_radians(rest).phase;
  const S radians_a_turn = S(2) * math::pi<S> / effective_ratio;
  return (gear.motor_phase(q) - theta - known).shortest(radians_a_turn);
}

}  // namespace flexspline
