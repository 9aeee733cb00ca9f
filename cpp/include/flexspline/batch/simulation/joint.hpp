/// What a simulated joint is made of, and the torques that act in it.
///
///   J_m θ̈ = τ_m − τ (1 + ∂θ_err/∂θ) − z/Ñ − friction            u = θ − Ñ q + θ_err(θ, q)
///   J q̈   = τ (Ñ − ∂θ_err/∂q) + z − τ_load − m g l sin(q − q₀) − ripple − friction
///
/// τ is the spring's torque at the wave generator, z the hysteresis (Maxwell-slip elements between
/// both sides), τ_load what the joint pushes on outside: a given torque and an obstacle. The
/// kinematic error works as a varying ratio, so it takes no energy. Structural damping is
/// proportional to θ̇/Ñ − q̇. A rigid gear is one mass, J + Ñ² J_m, at the output.
/// Source: full_range_torque_estimation Fig. 3, (2), (9)–(16), (23); Hunt & Crossley 1975 for the
/// obstacle.
#pragma once

#include <array>

#include "flexspline/batch/simulation/friction.hpp"
#include "flexspline/batch/simulation/spring.hpp"
#include "flexspline/batch/simulation/waves.hpp"

namespace flexspline::batch::simulation {

/// The two bodies; a rigid gear has the second one only.
enum Body : std::size_t { motor = 0, output = 1 };

inline constexpr std::size_t most_elements = 16;

/// An elastic element that slips at its level: between both sides of the gear (hysteresis), or
/// between a body and the housing (presliding). y = along[0] θ + along[1] q; z = k (y − anchor).
struct Element {
  double stiffness = 1;  ///< Nm/rad of y
  double level = 0;      ///< Nm
  std::array<double, 2> along{};
};

/// A stop in the way of the output: τ = k δ (1 + λ δ̇), δ ≥ 0 the depth.
struct Obstacle {
  double angle = 0;        ///< rad
  int direction = 1;       ///< +1: it stops positive motion
  double stiffness = 0;    ///< k, Nm/rad; 0: there is none
  double dissipation = 0;  ///< λ, s/rad
};

/// Two heat capacities in a row: motor, then the joint's body with the sensor, then the room.
struct Thermal {
  double motor_capacity = 0;  ///< J/K; 0: as the room
  double body_capacity = 0;   ///< J/K; 0: as the room
  double motor_to_body = 0;   ///< W/K
  double motor_to_room = 0;   ///< W/K
  double body_to_room = 0;    ///< W/K
  double copper_loss = 0;     ///< W/Nm², of the motor torque's square
};

struct Joint {
  double ratio = 1;           ///< Ñ
  double motor_inertia = 0;   ///< kg m²
  double output_inertia = 1;  ///< kg m², all that turns with q
  double link_inertia = 1;    ///< kg m², the part of it beyond the sensor
  double gravity = 0;         ///< m g l, Nm
  double gravity_angle = 0;   ///< rad, q where the link hangs
  double damping = 0;         ///< Nm s/rad at the output, between both sides
  double brake = 0;           ///< Nm at the motor, of the brake when it holds
  Spring spring;
  std::array<Friction, 2> friction;
  std::array<Element, most_elements> elements;
  std::size_t element_count = 0;
  Waves kinematic_error;  ///< rad at the motor side
  Waves current_ripple;   ///< Nm at the motor, part of τ_m
  Waves cogging;          ///< Nm at the motor, against motion where positive
  Waves output_ripple;    ///< Nm at the output, against motion where positive
  Waves friction_ripple;  ///< share of the output's Coulomb level
  Obstacle obstacle;
  Thermal thermal;

  // Filled by `prepared`.
  bool rigid = true;
  bool waves = false;               ///< some angle matters
  bool lossless = true;             ///< no friction and no structural damping
  bool eventless = true;            ///< nothing that sticks, slips or touches, but for the brake
  std::array<double, 2> inverse{};  ///< 1/kg m², of each body's inertia
  bool accounts = true;             ///< energies are wanted, or heat has to be known
  double inverse_ratio = 1;
  double mass = 1;  ///< kg m² at the output, of both bodies together
};

/// With what each step needs worked out.
inline Joint prepared(Joint joint) noexcept {
  joint.spring.ratio = joint.ratio;
  joint.spring = prepared(joint.spring);
  joint.rigid = joint.spring.rigid();
  joint.waves = !joint.kinematic_error.empty() || !joint.current_ripple.empty() ||
                !joint.cogging.empty() || !joint.output_ripple.empty() ||
                !joint.friction_ripple.empty();
  joint.lossless =
      joint.friction[motor].none() && joint.friction[output].none() && joint.damping == 0;
  joint.eventless = joint.friction[motor].smooth() && joint.friction[output].smooth() &&
                    joint.element_count == 0 && joint.obstacle.stiffness == 0;
  joint.inverse_ratio = 1 / joint.ratio;
  joint.mass = joint.output_inertia + joint.ratio * joint.ratio * joint.motor_inertia;
  joint.inverse = {joint.rigid ? 0 : 1 / joint.motor_inertia,
                   1 / (joint.rigid ? joint.mass : joint.output_inertia)};
  return joint;
}

/// Inputs over a stretch without jumps: linear in time.
struct Inputs {
  double start = 0;  ///< s
  double motor_torque = 0, motor_slope = 0;
  double load = 0, load_slope = 0;

  constexpr double motor_at(double t) const noexcept {
    return motor_torque + motor_slope * (t - start);
  }
  constexpr double load_at(double t) const noexcept { return load + load_slope * (t - start); }
};

/// Energy that went through since the start, J. Second order in the step.
struct Work {
  std::array<double, 2> friction{};  ///< heat of the friction of each body
  double gear = 0;                   ///< heat of hysteresis and structural damping
  double obstacle = 0;
  double motor = 0;   ///< put in by the motor, cogging and current ripple included
  double load = 0;    ///< taken out by the given load and the ripple
  double copper = 0;  ///< heat of the winding, not part of the balance
};

/// All that moves. A body's mode is its direction of sliding, or 0 where it sticks.
struct Motion {
  std::array<double, 2> position{};
  std::array<double, 2> velocity{};
  std::array<int, 2> mode{1, 1};
  SpringPoint spring;
  std::array<double, most_elements> anchor{};
  std::array<int, most_elements> slip{};
  bool contact = false;
  bool braked = false;
  std::array<double, 2> temperature{25, 25};
  std::array<Warmth, 2> warm{};
  Work work;
};

/// What the output meets outside, at frozen positions.
struct Outside {
  double load = 0;             ///< given load, Nm
  double gravity = 0;          ///< Nm
  double contact = 0;          ///< Nm, static part of the obstacle's torque
  double contact_damping = 0;  ///< Nm s/rad
  double ripple = 0;           ///< Nm
  double friction_share = 1;   ///< factor of the output's Coulomb level at this angle
};

/// What the gear and the elements do, at frozen positions.
struct Within {
  std::array<double, 2> on{};  ///< Nm on each body
  double spring = 0;           ///< τ at the wave generator
  double transmitted = 0;      ///< to the output: spring and hysteresis, without damping
};

/// Torques at frozen positions, without the friction of the bodies and structural damping.
struct Torques {
  std::array<double, 2> on;  ///< on each body, Nm at its side
  double motor_torque;       ///< at the shaft, current ripple included
  double cogging;
  Within within;
  Outside outside;
};

inline double stretch(const Element& element, const Motion& m) noexcept {
  return element.along[motor] * m.position[motor] + element.along[output] * m.position[output];
}

inline double element_torque(const Joint& joint, const Motion& m, std::size_t j) noexcept {
  const Element& element = joint.elements[j];
  if (m.slip[j] != 0) return m.slip[j] * element.level;
  return element.stiffness * (stretch(element, m) - m.anchor[j]);
}

/// Where the motor stands on a rigid gear.
inline double rigid_motor_angle(const Joint& joint, double q) noexcept {
  const double theta = joint.ratio * q;
  if (joint.kinematic_error.empty()) return theta;
  return theta - sum(joint.kinematic_error, Angle<double>::from_radians(theta).phase,
                     Angle<double>::from_radians(q).phase)
                     .value;
}

/// Gravity, given load, obstacle and ripple.
inline Outside outside(const Joint& joint, const Inputs& in, double t, const Motion& m,
                       Phase<double> theta, Phase<double> q) noexcept {
  Outside at{in.load_at(t)};
  if (joint.gravity != 0) {
    const auto hang = Angle<double>::from_radians(m.position[output] - joint.gravity_angle);
    at.gravity = joint.gravity * hang.phase.phasor().sine;
  }
  if (m.contact) {
    const Obstacle& obstacle = joint.obstacle;
    const double depth = obstacle.direction * (m.position[output] - obstacle.angle);
    at.contact = obstacle.direction * obstacle.stiffness * depth;
    at.contact_damping = obstacle.stiffness * depth * obstacle.dissipation;
  }
  if (!joint.output_ripple.empty()) at.ripple = sum(joint.output_ripple, theta, q).value;
  if (!joint.friction_ripple.empty()) {
    at.friction_share = 1 + sum(joint.friction_ripple, theta, q).value;
  }
  return at;
}

/// The spring of a compliant gear.
inline Within spring_torques(const Joint& joint, Motion& m, Phase<double> theta,
                             Phase<double> q) noexcept {
  WaveSum error;
  if (!joint.kinematic_error.empty()) error = sum(joint.kinematic_error, theta, q);
  const double windup = m.position[motor] - joint.ratio * m.position[output] + error.value;
  const double torque = torque_of(joint.spring, windup, m.spring);
  const double transmitted = torque * (joint.ratio - error.by_output);
  return {{-torque * (1 + error.by_motor), transmitted}, torque, transmitted};
}

/// Elements between the bodies, and between them and the housing.
inline void add_elements(const Joint& joint, const Motion& m, Within& at) noexcept {
  for (std::size_t j = 0; j < joint.element_count; ++j) {
    const Element& element = joint.elements[j];
    const double torque = element_torque(joint, m, j);
    at.on[motor] -= element.along[motor] * torque;
    at.on[output] -= element.along[output] * torque;
    if (element.along[motor] != 0 && element.along[output] != 0) {
      at.transmitted -= element.along[output] * torque;
    }
  }
}

/// All torques at the positions of `m`; the spring's neighbour point moves along.
inline Torques torques(const Joint& joint, const Inputs& in, double t, Motion& m) noexcept {
  Phase<double> theta;
  Phase<double> q;
  double motor_torque = in.motor_at(t);
  double cogging = 0;
  if (joint.waves) {
    if (joint.rigid) m.position[motor] = rigid_motor_angle(joint, m.position[output]);
    theta = Angle<double>::from_radians(m.position[motor]).phase;
    q = Angle<double>::from_radians(m.position[output]).phase;
    motor_torque += sum(joint.current_ripple, theta, q).value;
    cogging = sum(joint.cogging, theta, q).value;
  }
  Within within = joint.rigid ? Within{} : spring_torques(joint, m, theta, q);
  add_elements(joint, m, within);
  const Outside out = outside(joint, in, t, m, theta, q);
  const double driven = motor_torque - cogging;
  const double on_motor = joint.rigid ? 0 : within.on[motor] + driven;
  const double on_output = within.on[output] + (joint.rigid ? joint.ratio * driven : 0) -
                           (out.gravity + out.load + out.contact + out.ripple);
  return {{on_motor, on_output}, motor_torque, cogging, within, out};
}

}  // namespace flexspline::batch::simulation
