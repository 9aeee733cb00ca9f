/// One smooth step of a joint: a symmetric composition of drifts and kicks, fourth order.
///
///   drift   positions move, velocities stand
///   kick    velocities move, positions stand:  M v̇ = Q − B v − s f(s v)
///
/// Five drifts, four kicks (Omelyan, Mryglod & Folk 2002, "PEFRL", equation 20), each kick by the
/// Taylor series of its own equation to fourth order. Without friction and damping a kick is exact,
/// the composition is symplectic and time-reversible, so the energy has no drift: it swings about
/// its value by O(h⁴). Modes (direction of sliding, sticking, slipping) stand within a step, so a
/// step is smooth, also where a substep goes back in time. Stable while ω h < 2.98, ω the fastest
/// eigenfrequency.
#pragma once

#include "flexspline/batch/simulation/joint.hpp"

namespace flexspline::batch::simulation {

inline constexpr double stability_limit = 2.98;  ///< of ω h

/// What the output meets outside, without friction.
inline double outer_load(const Torques& at, const Motion& m) noexcept {
  const Outside& out = at.outside;
  return out.load + out.contact + out.contact_damping * m.velocity[output] + out.gravity +
         out.ripple;
}

/// Coulomb level of a body sliding along `direction`, without the part that the load adds.
inline double bare_level(const Joint& joint, const Torques& at, const Motion& m, std::size_t body,
                         int direction) noexcept {
  const double brake = m.braked ? joint.brake : 0;
  const double at_motor = m.warm[motor].coulomb * joint.friction[motor].coulomb(direction) + brake;
  if (body == motor) return at_motor;
  const double at_output = m.warm[output].coulomb * joint.friction[output].coulomb(direction) *
                           at.outside.friction_share;
  return joint.rigid ? at_output + joint.ratio * at_motor : at_output;
}

/// Nm of level for each Nm of load at this body.
inline double load_factor(const Joint& joint, std::size_t body, int direction) noexcept {
  const double own = joint.friction[body].load_factor(direction);
  return joint.rigid ? own + joint.friction[motor].load_factor(direction) : own;
}

/// What depends on velocity, at w = mode · v.
inline Resistance resistance(const Joint& joint, const Motion& m, std::size_t body,
                             double w) noexcept {
  Resistance r;
  add_resistance(joint.friction[body], m.warm[body], 1, w, r);
  if (joint.rigid) add_resistance(joint.friction[motor], m.warm[motor], joint.ratio, w, r);
  return r;
}

/// B: torque on each body by each velocity.
using Damping = std::array<std::array<double, 2>, 2>;
inline Damping damping(const Joint& joint, const Torques& at) noexcept {
  const double across = joint.damping * joint.inverse_ratio;
  return {{{across * joint.inverse_ratio, -across},
           {-across, joint.damping + at.outside.contact_damping}}};
}

/// The acceleration of one body with its slopes, and the friction that goes with it.
struct Slope {
  double acceleration = 0;
  double by_motor = 0;   ///< ∂/∂θ̇
  double by_output = 0;  ///< ∂/∂q̇
  double second = 0;     ///< ∂²/∂v², by its own velocity
  double third = 0;
  double friction = 0;  ///< s f, Nm, against motion
  double friction_slope = 0;
};
using Slopes = std::array<Slope, 2>;

/// A rigid gear's one mass M where friction grows by `factor` for each Nm of the torque
/// transmitted, |L + J q̈|: M q̈ = base − factor |L + J q̈|. The sign inside the bars is that of
/// L M + J base. Changes `inverse` to that of the mass that moves so; returns |L + J q̈|.
inline double carried_load(double mass, double output_inertia, double base, double load,
                           double factor, double& inverse) noexcept {
  const double both = load * mass + output_inertia * base;
  inverse = 1 / (mass + (both < 0 ? -factor : factor) * output_inertia);
  return math::absolute(both) * inverse;
}

/// Of one body; zero where it sticks.
inline Slope slope_of(const Joint& joint, const Torques& at, const Motion& m, const Damping& b,
                      std::size_t body) noexcept {
  const int s = m.mode[body];
  if (s == 0) return {};
  double inverse = joint.inverse[body];
  const Resistance r = resistance(joint, m, body, s * m.velocity[body]);
  const double factor = load_factor(joint, body, s);
  double level = bare_level(joint, at, m, body, s);
  const double carried = math::absolute(at.within.transmitted);
  if (!joint.rigid) level += factor * (body == motor ? carried * joint.inverse_ratio : carried);
  const double damped = b[body][motor] * m.velocity[motor] + b[body][output] * m.velocity[output];
  double base = at.on[body] - damped - s * (level + r.value);
  if (joint.rigid && factor != 0) {
    const double more = factor * carried_load(joint.mass, joint.output_inertia, base,
                                              outer_load(at, m), s * factor, inverse);
    base -= s * more;
    level += more;
  }
  Slope out{base * joint.inverse[body],
            -inverse * b[body][motor],
            -inverse * b[body][output],
            -inverse * s * r.second,
            -inverse * r.third,
            s * (level + r.value),
            r.first};
  (body == motor ? out.by_motor : out.by_output) -= inverse * r.first;
  return out;
}

inline Slopes slopes(const Joint& joint, const Torques& at, const Motion& m) noexcept {
  const Damping b = damping(joint, at);
  return {joint.rigid ? Slope{} : slope_of(joint, at, m, b, motor),
          slope_of(joint, at, m, b, output)};
}

/// Velocities after `k` seconds at frozen positions: Taylor series to fourth order.
inline std::array<double, 2> kicked(const Slopes& f, const std::array<double, 2>& v,
                                    double k) noexcept {
  const auto& [x, y] = f;
  const double ax = x.acceleration;
  const double ay = y.acceleration;
  const double bx = x.by_motor * ax + x.by_output * ay;
  const double by = y.by_motor * ax + y.by_output * ay;
  const double cx = x.by_motor * bx + x.by_output * by + x.second * ax * ax;
  const double cy = y.by_motor * bx + y.by_output * by + y.second * ay * ay;
  const double dx =
      x.by_motor * cx + x.by_output * cy + ax * (x.third * ax * ax + 3 * x.second * bx);
  const double dy =
      y.by_motor * cx + y.by_output * cy + ay * (y.third * ay * ay + 3 * y.second * by);
  const double half = k / 2;
  const double third = k / 3;
  const double fourth = k / 4;
  return {v[0] + k * (ax + half * (bx + third * (cx + fourth * dx))),
          v[1] + k * (ay + half * (by + third * (cy + fourth * dy)))};
}

/// The same of a rigid gear's one mass.
inline double kicked_alone(const Slope& y, double v, double k) noexcept {
  const double a = y.acceleration;
  const double b = y.by_output * a;
  const double c = y.by_output * b + y.second * a * a;
  const double d = y.by_output * c + a * (y.third * a * a + 3 * y.second * b);
  return v + k * (a + k / 2 * (b + k / 3 * (c + k / 4 * d)));
}

/// Work of motor and load during a kick, by the mean of its ends.
inline void add_input_work(const Joint& joint, const Torques& at,
                           const std::array<double, 2>& before, const std::array<double, 2>& after,
                           double k, Work& work) noexcept {
  const double v = (before[output] + after[output]) / 2;
  const double omega = joint.rigid ? joint.ratio * v : (before[motor] + after[motor]) / 2;
  work.motor += k * (at.motor_torque - at.cogging) * omega;
  work.load += k * (at.outside.load + at.outside.ripple) * v;
  work.copper += k * joint.thermal.copper_loss * at.motor_torque * at.motor_torque;
}

/// Heat during a kick, alike.
inline void add_heat(const Joint& joint, const Torques& at, const Slopes& f,
                     const std::array<double, 2>& before, const std::array<double, 2>& after,
                     double k, Work& work) noexcept {
  for (std::size_t i = 0; i < 2; ++i) {
    const double later = f[i].friction + f[i].friction_slope * (after[i] - before[i]);
    work.friction[i] += k / 2 * (f[i].friction * before[i] + later * after[i]);
  }
  const double v = (before[output] + after[output]) / 2;
  const double omega = (before[motor] + after[motor]) / 2;
  const double rate = omega * joint.inverse_ratio - v;
  work.gear += k * joint.damping * rate * rate;
  work.obstacle += k * at.outside.contact_damping * v * v;
}

inline void kick(const Joint& joint, const Inputs& in, double t, double k, Motion& m) noexcept {
  const Torques at = torques(joint, in, t, m);
  if (joint.lossless && !m.contact && !m.braked) {
    const std::array<double, 2> before = m.velocity;
    for (std::size_t i = 0; i < 2; ++i) m.velocity[i] += k * (joint.inverse[i] * at.on[i]);
    if (joint.accounts) add_input_work(joint, at, before, m.velocity, k, m.work);
    return;
  }
  const Slopes f = slopes(joint, at, m);
  const std::array<double, 2> after =
      joint.rigid ? std::array<double, 2>{0, kicked_alone(f[output], m.velocity[output], k)}
                  : kicked(f, m.velocity, k);
  if (joint.accounts) {
    add_input_work(joint, at, m.velocity, after, k, m.work);
    add_heat(joint, at, f, m.velocity, after, k, m.work);
  }
  m.velocity = after;
}

inline void drift(const Joint& joint, double k, Motion& m) noexcept {
  m.position[output] += k * m.velocity[output];
  m.position[motor] += k * m.velocity[motor];
  for (std::size_t j = 0; j < joint.element_count; ++j) {
    const Element& element = joint.elements[j];
    m.work.gear +=
        k * m.slip[j] * element.level *
        (element.along[motor] * m.velocity[motor] + element.along[output] * m.velocity[output]);
  }
}

/// One step of h seconds from time t in the modes that `m` has.
inline void smooth_step(const Joint& joint, const Inputs& in, double t, double h,
                        Motion& m) noexcept {
  constexpr double xi = 0.1786178958448091;
  constexpr double lambda = -0.2123418310626054;
  constexpr double chi = -0.06626458266981849;
  constexpr std::array<double, 4> move{xi, chi, 1 - 2 * (chi + xi), chi};
  constexpr std::array<double, 4> push{0.5 - lambda, lambda, lambda, 0.5 - lambda};
  double gone = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    drift(joint, h * move[i], m);
    gone += move[i];
    kick(joint, in, t + gone * h, h * push[i], m);
  }
  drift(joint, h * xi, m);
}

}  // namespace flexspline::batch::simulation
