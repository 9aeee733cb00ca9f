/// How far a strain wave gear twists under torque, and back from torsion to torque.
///
/// Signs are those of the log format: every torque is positive when the joint pushes outward, and
/// the torsion Δθ = q Ñ − θ is counted at the motor side. A motor that pushes a held output runs
/// ahead, so Δθ is then negative: both springs give torsions of the other sign than the torque.
///
///   Δθ = Ñ Δθ_m(τ) + Δθ_w(τ_m) + θ_err
///
///   mesh            Δθ_m = −atan(c_m τ) / (c_m K_m0)              τ at the output
///   wave generator  Δθ_w = −sgn(τ_m) (1 − e^(−c_w |τ_m|)) / (c_w K_w0)    τ_m at the motor
///
/// The mesh stiffens with torque (K = K_m0 (1 + (c_m τ)²)), the wave generator runs out of way at
/// 1/(c_w K_w0): lost motion. Both store energy, −∫ τ dΔθ ≥ 0, whatever the sign of the torque.
/// With c = 0 either is a plain spring of its K.
///
/// Source: full_range_torque_estimation (15), (16), (18), there after its ref. 17. What the text
/// has otherwise: τ_c of (10), (15), (18) is positive when the outside drives the output, hence
/// no minus in (15), while τ_c of (1), (2), (17) is positive outward, so that (19) as printed
/// averages a torque with its negative; (16) lacks its minus by the definition (11) of Δθ; (11)
/// itself should read q Ñ − θ = θ_c Ñ − θ_w; c_c, K_c0 of (15) are c_m, K_m0; stiffness is Nm/rad,
/// not Nm rad. (18) has a pole at |Δθ_m| = π / (2 c_m K_m0), of which the text says nothing.
#pragma once

#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

/// Torsion of the tooth mesh, rad at the output side (Ñ times that at the motor side), for a
/// torque in Nm at the output; `stiffness` K_m0 > 0 in Nm/rad, `shape` c_m ≥ 0 in 1/Nm. (15)
template <typename S>
constexpr S mesh_torsion(S torque, S stiffness, S shape) noexcept {
  const S bent = shape == S(0) ? torque : math::atan(shape * torque) / shape;
  return -bent / stiffness;
}

/// Torque through the tooth mesh, from its torsion in rad at the output side: the inverse. (18)
///
///   τ = −tan(c_m K_m0 Δθ_m) / c_m,   |c_m K_m0 Δθ_m| held at (1 − margin) π/2
///
/// Held there: `saturated`; the torque keeps its sign and is the largest that the model is
/// trusted with, about 2 / (π margin c_m). `margin` in (0, 1): share of the way to the pole kept
/// free. NaN in gives NaN out.
template <typename S>
constexpr FlaggedTorque<S> mesh_torque(S torsion, S stiffness, S shape, S margin) noexcept {
  if (shape == S(0)) return {-stiffness * torsion, Flag::none};
  const S limit = (S(1) - margin) * (math::pi<S> / S(2));
  S bent = shape * stiffness * torsion;
  Flag held = Flag::none;
  if (math::absolute(bent) > limit) [[unlikely]] {
    bent = bent < S(0) ? -limit : limit;
    held = Flag::saturated;
  }
  return {math::tan(bent) * (S(-1) / shape), held};
}

/// Torsion of the wave generator, rad at the motor side, for a motor torque in Nm at the motor
/// side; `stiffness` K_w0 > 0 in Nm/rad, `shape` c_w ≥ 0 in 1/Nm. (16)
template <typename S>
constexpr S wave_generator_torsion(S motor_torque, S stiffness, S shape) noexcept {
  const S size = math::absolute(motor_torque);
  const S bent = shape == S(0) ? size : -math::expm1_negative(shape * size) / shape;
  return (motor_torque < S(0) ? bent : -bent) / stiffness;
}

}  // namespace flexspline
