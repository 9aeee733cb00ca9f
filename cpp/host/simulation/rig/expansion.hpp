/// The motion of a smooth joint from one instant on, as a power series in time.
///
///   v(t + σ T) = Σ v_k σᵏ,     (k + 1) v_{k+1} = T/J · (net torque)_k
///
/// Of a sine s = sin x, c = cos x and a tangent y = tan x the terms follow from those of x′:
/// s′ = c x′, c′ = −s x′, y′ = (1 + y²) x′. Torques of motor and load are linear in time. With
/// losses a series is the cheapest way to any accuracy: it is worked out to as many terms as are
/// wanted, goes as far as they reach, and gives every instant on the way. It is not symplectic:
/// without losses the energy moves within the accuracy, so such joints go by steps (`step.hpp`).
/// Source: [JorbaZou2005], sections 2 and 3.
#pragma once

#include "host/simulation/rig/joint.hpp"
#include "host/simulation/rig/series.hpp"

namespace flexspline::batch::simulation {

/// True where the joint's equation is one of the series here, and loses energy.
constexpr bool expandable(const Joint& joint) noexcept {
  return joint.kind != Kind::anything && !joint.lossless;
}

/// Terms in σ; those beyond `order` mean nothing.
struct Expansion {
  double unit = 0;        ///< s, T
  std::size_t order = 0;  ///< of the last velocity that is known
  std::array<Coefficients, 2> velocity;
  std::array<Coefficients, 2> squared;   ///< of the velocities
  std::array<Coefficients, 2> friction;  ///< Nm, against motion
  std::array<Viscous, 2> smooth;
  Coefficients sine, cosine;  ///< of the angle against gravity
  Coefficients rate;          ///< of the tangent's argument
  Coefficients tangent, steepness;
  double spring_scale = 0;  ///< Nm at the motor side, of the tangent
  double spring_bend = 0;   ///< how far up the tangent a wind-up is
  Ramp motor_torque, load;  ///< in σ
};

/// Where the series starts: `e.unit` is set.
template <Kind kind>
inline void first_terms(const Joint& joint, const Inputs& in, double t, const Motion& m,
                        Expansion& e) noexcept {
  e.order = 0;
  e.velocity[output][0] = m.velocity[output];
  e.motor_torque = {in.motor_at(t), in.motor_torque.slope * e.unit};
  e.load = {in.load_at(t), in.load.slope * e.unit};
  e.smooth[output] = smooth_friction(joint.friction[output], m.warm[output], 1);
  if (joint.gravity != 0) {
    const double angle = m.position[output] - joint.gravity_angle;
    const auto phasor = Angle<double>::from_radians(angle).phase.phasor();
    e.sine[0] = phasor.sine;
    e.cosine[0] = phasor.cosine;
  }
  const Viscous at_motor = smooth_friction(joint.friction[motor], m.warm[motor],
                                           is_rigid<kind>(joint) ? joint.ratio : 1);
  if constexpr (kind == Kind::smooth_rigid) {
    e.smooth[output].linear += at_motor.linear;
    e.smooth[output].cubic += at_motor.cubic;
  } else {
    const Spring& spring = joint.spring;
    e.smooth[motor] = at_motor;
    e.velocity[motor][0] = m.velocity[motor];
    e.spring_bend = spring.linear() ? 1 : spring.mesh_bend;
    e.spring_scale = spring.linear() ? spring.mesh_motor_stiffness : spring.mesh_scale;
    const double windup = m.position[motor] - joint.ratio * m.position[output];
    e.tangent[0] = spring.linear() ? windup : mesh_tangent(spring, windup);
    e.steepness[0] = 1 + e.tangent[0] * e.tangent[0];
  }
}

/// Term k of an input that is linear in time.
constexpr double term(const Ramp& linear, std::size_t k) noexcept {
  return k == 0 ? linear.value : k == 1 ? linear.slope : 0;
}

/// Term k of a body's friction.
inline double extend_friction(Expansion& e, std::size_t body, std::size_t k) noexcept {
  const Coefficients& v = e.velocity[body];
  double torque = e.smooth[body].linear * v[k];
  if (e.smooth[body].cubic != 0) {
    e.squared[body][k] = square(v, k);
    torque += e.smooth[body].cubic * product(e.squared[body], v, k);
  }
  e.friction[body][k] = torque;
  return torque;
}

/// Term k of gravity's torque.
inline double extend_gravity(const Joint& joint, Expansion& e, std::size_t k) noexcept {
  if (joint.gravity == 0) return 0;
  if (k > 0) {
    const double part = e.unit * reciprocal[k];
    e.sine[k] = part * product(e.cosine, e.velocity[output], k - 1);
    e.cosine[k] = -part * product(e.sine, e.velocity[output], k - 1);
  }
  return joint.gravity * e.sine[k];
}

/// Term k of the spring's torque, Nm at the motor side.
inline double extend_spring(const Joint& joint, Expansion& e, std::size_t k) noexcept {
  const double turning = e.velocity[motor][k] - joint.ratio * e.velocity[output][k];
  e.rate[k] = e.spring_bend * e.unit * turning;
  if (k > 0) {
    const bool linear = joint.spring.linear();
    const double slope = linear ? e.rate[k - 1] : product(e.steepness, e.rate, k - 1);
    e.tangent[k] = reciprocal[k] * slope;
    if (!linear) e.steepness[k] = square(e.tangent, k);
  }
  return e.spring_scale * e.tangent[k];
}

/// One order more of the velocities.
template <Kind kind>
inline void extend(const Joint& joint, Expansion& e) noexcept {
  constexpr bool rigid = kind == Kind::smooth_rigid;
  const std::size_t k = e.order++;
  BodyTorques gear{};
  BodyTorques damped{};
  BodyTorques friction{};
  if constexpr (!rigid) {
    const double spring = extend_spring(joint, e, k);
    gear = {-spring, joint.ratio * spring};
    const Damping b = damping_between(joint.damping, joint.inverse_ratio, 0);
    for (const Body body : {motor, output}) {
      damped[body] = damped_torque(b[body], e.velocity[motor][k], e.velocity[output][k]);
    }
    friction[motor] = extend_friction(e, motor, k);
  }
  friction[output] = extend_friction(e, output, k);
  const double outside = extend_gravity(joint, e, k) + term(e.load, k);
  const BodyTorques on =
      standing_torques(rigid, joint.ratio, term(e.motor_torque, k), gear, outside);
  const double part = e.unit * reciprocal[k + 1];
  for (std::size_t body = rigid ? output : motor; body <= output; ++body) {
    e.velocity[body][k + 1] =
        part * joint.inverse[body] * net_torque(on[body], damped[body], friction[body]);
  }
}

/// How large term k of the velocities is, rad/s at the output.
template <Kind kind>
inline double term_size(const Joint& joint, const Expansion& e, std::size_t k) noexcept {
  const double at_output = math::absolute(e.velocity[output][k]);
  if constexpr (kind == Kind::smooth_rigid) return at_output;
  const double at_motor = math::absolute(e.velocity[motor][k]) * joint.inverse_ratio;
  return at_motor > at_output ? at_motor : at_output;
}

/// The largest order worth its terms at this accuracy: orders cost their square.
inline std::size_t best_order(double accuracy) noexcept {
  const double wanted = 3 - 0.65 * math::log(accuracy);
  return wanted < static_cast<double>(most_terms) ? static_cast<std::size_t>(wanted) : most_terms;
}

/// The radius of convergence to an accuracy, as a share of `e.unit`: over it the last two terms
/// stay below `accuracy` of the motion. It is looked for from `guess` downwards, and may be too
/// short where the guess is.
template <Kind kind>
inline double convergence_radius(const Joint& joint, const Expansion& e, double accuracy,
                                 double guess) noexcept {
  const std::array<std::size_t, 2> last{e.order - 1, e.order};
  for (;;) {
    // Inputs are linear: what does not move by these terms does not move at all.
    const double motion =
        term_size<kind>(joint, e, 0) +
        guess * (term_size<kind>(joint, e, 1) + guess * term_size<kind>(joint, e, 2));
    double least = 0;
    for (const std::size_t k : last) {
      const double size = term_size<kind>(joint, e, k);
      const double bound = accuracy * motion;
      const double longest = size > bound ? math::log(bound / size) * reciprocal[k] : 0;
      if (longest < least) least = longest;
    }
    const double share = math::exp(least);
    if (!(share < guess / 2) || share == 0) return share;
    guess = share;
  }
}

/// Works out terms until two in a row are below `accuracy` of the motion over the whole unit, or
/// up to order `most`. Returns the share of the unit over which the series is so accurate.
template <Kind kind>
inline double expand(const Joint& joint, std::size_t most, double accuracy, double guess,
                     Expansion& e) noexcept {
  double motion = term_size<kind>(joint, e, 0);
  bool small = false;
  while (e.order < most) {
    extend<kind>(joint, e);
    const double size = term_size<kind>(joint, e, e.order);
    if (e.order <= 2) {
      motion += size;
      continue;
    }
    const bool fits = size <= accuracy * motion;
    if (fits && small) return 1;
    small = fits;
  }
  return convergence_radius<kind>(joint, e, accuracy, guess);
}

}  // namespace flexspline::batch::simulation
