/// The compliant gear: tooth mesh and wave generator in series.
///
///   u(τ) = Ñ atan(c_m Ñ τ) / (c_m K_m) + sgn(τ) (1 − e^(−c_w |τ|)) / (c_w K_w)
///
/// u is the wind-up at the motor side, by which the motor runs ahead: u = θ − Ñ q + θ_err, that is
/// −Δθ but for the kinematic error. τ is the torque at the wave generator that really passes, Ñ τ
/// the one at the output: a spring in series has one torque, so its energy is a function of u alone
/// and nothing is lost in it. A stiffness of 0 means rigid, a shape c of 0 means linear. The
/// inverse has no closed form; it is found from a neighbour by the third-order series of the
/// inverse function, repeated until nothing moves. |u| ends at a pole.
/// Source: full_range_torque_estimation (9)–(16), [Zhang2015], with the signs of the log.
#pragma once

#include "flexspline/gear_compliance.hpp"
#include "host/simulation/rig/near.hpp"

namespace flexspline::batch::simulation {

struct Spring {
  double ratio = 1;                     ///< Ñ
  double mesh_stiffness = 0;            ///< K_m, Nm/rad at the output; 0: rigid
  double mesh_shape = 0;                ///< c_m, 1/Nm at the output; 0: linear
  double wave_generator_stiffness = 0;  ///< K_w, Nm/rad at the motor side; 0: rigid
  double wave_generator_shape = 0;      ///< c_w, 1/Nm at the motor side; 0: linear

  double mesh_softness = 0;  ///< filled by `prepared`
  double wave_generator_softness = 0;
  double mesh_motor_stiffness = 0;  ///< of the mesh, Nm/rad at the motor side
  double mesh_bend = 0;             ///< c_m K_m / Ñ: how far up the tangent a wind-up is
  double mesh_scale = 0;            ///< 1/(c_m Ñ), Nm at the motor side; 0 where linear
  double inverse_ratio = 1;

  /// The shape of a part that is rigid means nothing.
  constexpr bool linear() const noexcept {
    return (mesh_stiffness == 0 || mesh_shape == 0) &&
           (wave_generator_stiffness == 0 || wave_generator_shape == 0);
  }
  constexpr bool rigid() const noexcept {
    return mesh_stiffness == 0 && wave_generator_stiffness == 0;
  }
};

/// With the quotients that each step needs.
constexpr Spring prepared(Spring spring) noexcept {
  spring.inverse_ratio = 1 / spring.ratio;
  if (spring.mesh_stiffness > 0) {
    spring.mesh_motor_stiffness = spring.mesh_stiffness / (spring.ratio * spring.ratio);
    spring.mesh_softness = spring.ratio * spring.ratio / spring.mesh_stiffness;
    spring.mesh_bend = spring.mesh_shape * spring.mesh_stiffness / spring.ratio;
    spring.mesh_scale = spring.mesh_shape > 0 ? 1 / (spring.mesh_shape * spring.ratio) : 0;
  }
  if (spring.wave_generator_stiffness > 0) {
    spring.wave_generator_softness = 1 / spring.wave_generator_stiffness;
  }
  return spring;
}

/// True where the wind-up has a largest value.
constexpr bool has_pole(const Spring& spring) noexcept {
  const bool mesh_ends = spring.mesh_stiffness == 0 || spring.mesh_shape > 0;
  const bool generator_ends =
      spring.wave_generator_stiffness == 0 || spring.wave_generator_shape > 0;
  return !spring.rigid() && mesh_ends && generator_ends;
}

/// u at a torque, and its derivatives by the torque: the first one's inverse, which is the
/// stiffness, and the next two in units of the first.
struct SpringPoint {
  double torque = 0;
  double windup = 0;
  double stiffness = 0;
  double bend = 0;
  double twist = 0;
};

inline SpringPoint spring_at(const Spring& spring, double torque) noexcept {
  double windup = 0;
  double first = 0;
  double second = 0;
  double third = 0;
  if (spring.mesh_stiffness > 0) {
    const double c = spring.mesh_shape * spring.ratio;
    const double a = c * torque;
    const double n = 1 / (1 + a * a);
    windup = -spring.ratio *
             mesh_torsion(spring.ratio * torque, spring.mesh_stiffness, spring.mesh_shape);
    first = spring.mesh_softness * n;
    second = -2 * first * c * a * n;
    third = first * c * c * n * (8 * a * a * n - 2);
  }
  if (spring.wave_generator_stiffness > 0) {
    const double c = spring.wave_generator_shape;
    const double left = 1 + math::expm1(-c * math::absolute(torque));
    const double softness = spring.wave_generator_softness * left;
    windup -= wave_generator_torsion(torque, spring.wave_generator_stiffness, c);
    first += softness;
    second -= (torque < 0 ? -c : c) * softness;
    third += c * c * softness;
  }
  const double stiffness = 1 / first;
  return {torque, windup, stiffness, second * stiffness, third * stiffness};
}

/// How far the torque is from `p` where the wind-up is larger by `more`: series to third order.
constexpr double torque_step(const SpringPoint& p, double more) noexcept {
  const double x = more * p.stiffness;
  return x * (1 + x * (-0.5 * p.bend + x * (0.5 * p.bend * p.bend - p.twist / 6)));
}

/// Newton from zero: u is concave on one side of it, so the steps never pass the root. Infinite
/// beyond the pole.
inline double torque_from_rest(const Spring& spring, double windup, SpringPoint& p) noexcept {
  const double target = math::absolute(windup);
  double torque = 0;
  for (int i = 0; i < 200; ++i) {
    p = spring_at(spring, torque);
    const double step = (target - p.windup) * p.stiffness;
    if (!(step < 1e12) || !math::is_finite(step)) break;
    torque += step;
    if (math::absolute(step) <= 4e-16 * torque || (i > 60 && step <= 0)) {
      p = spring_at(spring, windup < 0 ? -torque : torque);
      return p.torque;
    }
  }
  return std::numeric_limits<double>::infinity();
}

/// How far a wind-up of the mesh alone is up its tangent, tan(c_m K_m u / Ñ); infinite beyond the
/// pole. It is (18) of the core, `mesh_torque`, without its margin: c_m Ñ τ.
constexpr double mesh_tangent(const Spring& spring, double windup) noexcept {
  const double bent = spring.mesh_bend * windup;
  const bool beyond = math::absolute(bent) > math::pi<double> / 2;
  return beyond ? std::numeric_limits<double>::infinity() : near_tangent(bent);
}

/// The torque where the mesh alone gives: (18). Infinite beyond the pole.
inline double mesh_torque_of(const Spring& spring, double windup, SpringPoint& p) noexcept {
  const double tangent = mesh_tangent(spring, windup);
  p.stiffness = (1 + tangent * tangent) * spring.mesh_motor_stiffness;
  p.torque = tangent * spring.mesh_scale;
  return p.torque;
}

/// The torque of a wind-up; `p`, a point near it from the last call, is moved along.
inline double torque_of(const Spring& spring, double windup, SpringPoint& p) noexcept {
  if (spring.linear()) return windup * p.stiffness;
  if (spring.wave_generator_stiffness == 0) return mesh_torque_of(spring, windup, p);
  for (int i = 0; i < 4; ++i) {
    const double guess = p.torque + torque_step(p, windup - p.windup);
    if (!math::is_finite(guess)) break;
    p = spring_at(spring, guess);
    const double more = windup - p.windup;
    const double torque = p.torque + torque_step(p, more);
    const bool same_side = torque * guess > 0 || spring.wave_generator_shape == 0;
    // What is left is of fourth order: 1e-16 of the torque over which the spring bends.
    if (math::absolute(more * p.stiffness * p.bend) < 1e-4 && same_side) return torque;
  }
  const double torque = torque_from_rest(spring, windup, p);
  if (!math::is_finite(torque)) p = spring_at(spring, 0);
  return torque;
}

/// x with its cancellation taken out: (1 − e^(−y) (1 + y)) / y².
inline double stored_share(double y) noexcept {
  if (y > 0.05) return (-math::expm1(-y) - y * math::exp(-y)) / (y * y);
  return math::polynomial(y, 0.5, -1.0 / 3, 1.0 / 8, -1.0 / 30, 1.0 / 144, -1.0 / 840, 1.0 / 5760,
                          -1.0 / 45360);
}

/// Energy in the gear at a torque (motor side), J.
inline double stored_energy(const Spring& spring, double torque) noexcept {
  double energy = 0;
  if (spring.mesh_stiffness > 0) {
    const double output = spring.ratio * torque;
    const double a = spring.mesh_shape * output;
    const double share = a * a < 1e-9 ? 1 - 0.5 * a * a : math::log(1 + a * a) / (a * a);
    energy += 0.5 * output * output * share / spring.mesh_stiffness;
  }
  if (spring.wave_generator_stiffness > 0) {
    const double y = spring.wave_generator_shape * math::absolute(torque);
    energy += torque * torque * stored_share(y) / spring.wave_generator_stiffness;
  }
  return energy;
}

}  // namespace flexspline::batch::simulation
