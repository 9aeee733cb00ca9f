/// The equation of motion of a joint, one for all that integrate it: steps and series of the rig,
/// and the fitted plant.
///
///   with a spring   J_m θ̈ = τ_m + g_m − d_m − f_m,    d_m = (b/Ñ) (θ̇/Ñ − q̇)
///                   J q̈   = g − o − d − f,            d   = −b (θ̇/Ñ − q̇) + c q̇
///   rigid           M q̈   = Ñ τ_m + g − o − d − f,    M = J + Ñ² J_m
///
/// τ_m drives the motor; g is what springs and slip elements do to a body, o what the output pushes
/// on outside, without the damping c of a contact, f friction, positive against positive motion. The
/// equation is linear in them, so it holds of each term of their power series as of their values.
///
/// Friction that grows with the load transmitted, L + J q̈ (L: o with its damping), has q̈ on both
/// sides, and is solved for:
///
///   M q̈ = base − f |L + J q̈|    ⇒    L + J q̈ = (M L + J base) / (M ± f J),   |f J| < M
///
/// ± is the sign of M L + J base, and so of the load.
#pragma once

#include <array>
#include <cstddef>

#include "flexspline/math.hpp"

namespace flexspline::batch::simulation {

/// The two bodies; a rigid gear has the second one only.
enum Body : std::size_t { motor = 0, output = 1 };

/// A torque at each of them, Nm at its side.
using BodyTorques = std::array<double, 2>;

/// τ_m + g_m and g − o, or 0 and Ñ τ_m + g − o: what does not depend on velocity.
constexpr BodyTorques standing_torques(bool rigid, double ratio, double driven,
                                       const BodyTorques& gear, double outside) noexcept {
  return {rigid ? 0 : gear[motor] + driven, gear[output] + (rigid ? ratio * driven : 0) - outside};
}

/// J_m θ̈, J q̈ or M q̈.
constexpr double net_torque(double standing, double damped, double friction) noexcept {
  return standing - damped - friction;
}

/// ∂d/∂velocity: torque on each body by each velocity.
using Damping = std::array<std::array<double, 2>, 2>;
constexpr Damping damping_between(double structural, double inverse_ratio,
                                  double contact) noexcept {
  const double across = structural * inverse_ratio;
  return {{{across * inverse_ratio, -across}, {-across, structural + contact}}};
}

/// d of one body.
constexpr double damped_torque(const std::array<double, 2>& damping, double at_motor,
                               double at_output) noexcept {
  return damping[motor] * at_motor + damping[output] * at_output;
}

/// 1/(M ± f J), ± the sign of `both`, M L + J base.
constexpr double loaded_inverse(double mass, double inertia, double factor, double both) noexcept {
  return 1 / (mass + (both < 0 ? -factor : factor) * inertia);
}

/// |L + J q̈|. Changes `inverse` to that of the mass that moves so, 1/(M ± f J).
constexpr double carried_load(double mass, double inertia, double base, double load, double factor,
                              double& inverse) noexcept {
  const double both = load * mass + inertia * base;
  inverse = loaded_inverse(mass, inertia, factor, both);
  return math::absolute(both) * inverse;
}

}  // namespace flexspline::batch::simulation
