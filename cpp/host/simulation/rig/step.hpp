/// One smooth step of a joint: a symmetric composition of drifts and kicks, fourth order.
///
///   drift   positions move, velocities stand
///   kick    velocities move, positions stand:  M v̇ = Q − B v − s f(s v)
///
/// Orders 4 and 6 (`composition.hpp`), each kick by the Taylor series of its own equation to that
/// order. Without friction and damping a kick is exact, the composition is symplectic and
/// time-reversible, so the energy has no drift: it swings about its value by O(h^order). Modes
/// (direction of sliding, sticking, slipping) stand within a step, so a step is smooth, also where
/// a substep goes back in time. Order 6 needs friction that is a polynomial (no Stribeck).
#pragma once

#include "host/simulation/rig/composition.hpp"
#include "host/simulation/rig/joint.hpp"

namespace flexspline::batch::simulation {

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

/// B of the joint with what it touches.
inline Damping damping(const Joint& joint, const Torques& at) noexcept {
  return damping_between(joint.damping, joint.inverse_ratio, at.outside.contact_damping);
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
  const double damped = damped_torque(b[body], m.velocity[motor], m.velocity[output]);
  double base = net_torque(at.on[body], damped, s * (level + r.value));
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

/// Velocities after `k` seconds at frozen positions: Taylor series to the order, of
/// w′ = a + B w + ½ s w² + t/6 w³, w the change; `bent` says that the motor has s or t.
template <int order, bool bent>
inline std::array<double, 2> kicked(const Slopes& f, const std::array<double, 2>& v,
                                    double k) noexcept {
  const auto& [x, y] = f;
  const double ax = x.acceleration;
  const double ay = y.acceleration;
  const double bx = x.by_motor * ax + x.by_output * ay;
  const double by = y.by_motor * ax + y.by_output * ay;
  double cx = x.by_motor * bx + x.by_output * by;
  const double cy = y.by_motor * bx + y.by_output * by + y.second * ay * ay;
  if constexpr (bent) cx += x.second * ax * ax;
  double dx = x.by_motor * cx + x.by_output * cy;
  const double dy =
      y.by_motor * cx + y.by_output * cy + ay * (y.third * ay * ay + 3 * y.second * by);
  if constexpr (bent) dx += ax * (x.third * ax * ax + 3 * x.second * bx);
  const double k2 = k * k * (1.0 / 2);
  const double k3 = k * k2 * (1.0 / 3);
  const double k4 = k2 * k2 * (1.0 / 6);
  const double to_x = ((v[0] + k * ax) + (k2 * bx + k3 * cx)) + k4 * dx;
  const double to_y = ((v[1] + k * ay) + (k2 * by + k3 * cy)) + k4 * dy;
  if constexpr (order == 4) return {to_x, to_y};
  double ex = x.by_motor * dx + x.by_output * dy;
  const double ey = y.by_motor * dx + y.by_output * dy + y.second * (4 * ay * cy + 3 * by * by) +
                    6 * y.third * ay * ay * by;
  if constexpr (bent) {
    ex += x.second * (4 * ax * cx + 3 * bx * bx) + 6 * x.third * ax * ax * bx;
  }
  double fx = x.by_motor * ex + x.by_output * ey;
  const double fy = y.by_motor * ex + y.by_output * ey + y.second * (5 * ay * dy + 10 * by * cy) +
                    y.third * ay * (10 * ay * cy + 15 * by * by);
  if constexpr (bent) {
    fx += x.second * (5 * ax * dx + 10 * bx * cx) + x.third * ax * (10 * ax * cx + 15 * bx * bx);
  }
  const double k5 = k2 * k3 * (1.0 / 10);
  const double k6 = k3 * k3 * (1.0 / 20);
  return {to_x + (k5 * ex + k6 * fx), to_y + (k5 * ey + k6 * fy)};
}

/// The same of a rigid gear's one mass, to sixth order, as a polynomial in a: the rest is known
/// before the torque is.
inline double kicked_alone(const Slope& y, double v, double k) noexcept {
  const double a = k * y.acceleration;
  const double b = k * y.by_output;
  const double s = k * y.second * 0.5;
  const double t = k * y.third * (1.0 / 6);
  const double b2 = b * b;
  const double first = ((1 + b * (1.0 / 2)) + b2 * (1.0 / 6 + b * (1.0 / 24))) +
                       b2 * b2 * ((1.0 / 120 + b * (1.0 / 720)) + b2 * (1.0 / 5040));
  const double second = s * ((1.0 / 3 + b * (1.0 / 3)) + b2 * (11.0 / 60 + b * (13.0 / 180)));
  const double third =
      t * ((1.0 / 4 + b * (7.0 / 20)) + b2 * (4.0 / 15)) + s * s * (2.0 / 15 + b * (17.0 / 90));
  const double fourth = s * t * (1.0 / 4);
  const double a2 = a * a;
  return (v + a * first) + a2 * ((second + a * third) + a2 * fourth);
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

template <Kind kind, int order>
inline void kick(const Joint& joint, const Inputs& in, double t, double k, Motion& m) noexcept {
  const Torques at = torques<kind>(joint, in, t, m);
  if (joint.lossless && !m.contact && !m.braked) {
    const std::array<double, 2> before = m.velocity;
    for (std::size_t i = 0; i < 2; ++i) m.velocity[i] += k * (joint.inverse[i] * at.on[i]);
    if (joint.accounts) add_input_work(joint, at, before, m.velocity, k, m.work);
    return;
  }
  const Slopes f = slopes(joint, at, m);
  std::array<double, 2> after{};
  if (is_rigid<kind>(joint)) {
    after[output] = kicked_alone(f[output], m.velocity[output], k);
  } else if (f[motor].second != 0 || f[motor].third != 0) {
    after = kicked<order, true>(f, m.velocity, k);
  } else {
    after = kicked<order, false>(f, m.velocity, k);
  }
  if (joint.accounts) {
    add_input_work(joint, at, m.velocity, after, k, m.work);
    add_heat(joint, at, f, m.velocity, after, k, m.work);
  }
  m.velocity = after;
}

template <Kind kind>
inline void drift(const Joint& joint, double k, Motion& m) noexcept {
  std::array<double, most_elements> before{};
  if constexpr (kind == Kind::anything) {
    for (std::size_t j = 0; j < joint.element_count; ++j) before[j] = stretch(joint.elements[j], m);
  }
  m.position[output] += k * m.velocity[output];
  if constexpr (kind != Kind::smooth_rigid) m.position[motor] += k * m.velocity[motor];
  if constexpr (kind != Kind::anything) return;
  m.error = error_at(joint, m);
  for (std::size_t j = 0; j < joint.element_count; ++j) {
    const Element& element = joint.elements[j];
    m.work.gear += m.slip[j] * element.level * (stretch(element, m) - before[j]);
  }
}

/// One step of h seconds from time t in the modes that `m` has.
template <Kind kind = Kind::anything, int order = 4>
inline void smooth_step(const Joint& joint, const Inputs& in, double t, double h,
                        Motion& m) noexcept {
  constexpr const auto& parts = composition<order>;
  double gone = 0;
  for (std::size_t i = 0; i < parts.push.size(); ++i) {
    drift<kind>(joint, h * parts.move[i], m);
    gone += parts.move[i];
    kick<kind, order>(joint, in, t + gone * h, h * parts.push[i], m);
  }
  drift<kind>(joint, h * parts.move.back(), m);
}

}  // namespace flexspline::batch::simulation
