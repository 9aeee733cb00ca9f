/// What a simulated joint is made of, and the torques that act in it (`equation_of_motion.hpp`).
///
///   g_m = −(τ + z/Ñ) (1 + ∂θ_err/∂θ)         u = θ − Ñ q + θ_err(θ, q)
///   g   = (τ + z/Ñ) (Ñ − ∂θ_err/∂q),         o = τ_load + m g l sin(q − q₀) + ripple
///
/// τ is the spring's torque at the wave generator, z the hysteresis: Maxwell-slip elements beside
/// the spring, which see u/Ñ as it does, so the kinematic error of the teeth does not work against
/// them. τ_load is what the joint pushes on outside: a given torque and an obstacle. The kinematic
/// error works as a varying ratio, so it takes no energy. Structural damping is proportional to
/// θ̇/Ñ − q̇. A rigid gear is one mass, J + Ñ² J_m, at the output.
/// Source: full_range_torque_estimation Fig. 3, (2), (9)–(16), (23); [HuntCrossley1975] for the
/// obstacle.
#pragma once

#include <array>

#include "host/simulation/common/equation_of_motion.hpp"
#include "host/simulation/common/ramp.hpp"
#include "host/simulation/rig/friction.hpp"
#include "host/simulation/rig/spring.hpp"
#include "host/simulation/rig/surroundings.hpp"
#include "host/simulation/rig/waves.hpp"

namespace flexspline::batch::simulation {

inline constexpr std::size_t most_elements = 16;

/// An elastic element that slips at its level: between both sides of the gear (hysteresis), or
/// between a body and the housing (presliding). y = along[0] θ + along[1] q; z = k (y − anchor).
struct Element {
  double stiffness = 1;  ///< Nm/rad of y
  double level = 0;      ///< Nm
  std::array<double, 2> along{};
};

/// What of a joint a run can meet, known before it starts, so that it does not pay for the rest:
/// no angle matters but gravity's, the gear is rigid or all in the mesh, and nothing can stick,
/// slip, touch or brake; or anything.
enum class Kind : std::uint8_t { anything, smooth_rigid, smooth_mesh };

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
  Kind kind = Kind::anything;
  double spread = 0;  ///< 1/J_m + Ñ²/J: eigenfrequency's square by stiffness; 0: rigid
  double inverse_ratio = 1;
  double mass = 1;  ///< kg m² at the output, of both bodies together
};

/// With what each step needs worked out.
inline Joint prepared(Joint joint) noexcept {
  joint.spring.ratio = joint.ratio;
  joint.spring = prepared(joint.spring);
  joint.rigid = joint.spring.rigid();
  if (joint.rigid) joint.damping = 0;  // both sides turn as one
  joint.waves = !joint.kinematic_error.empty() || !joint.current_ripple.empty() ||
                !joint.cogging.empty() || !joint.output_ripple.empty() ||
                !joint.friction_ripple.empty();
  joint.lossless =
      joint.friction[motor].none() && joint.friction[output].none() && joint.damping == 0;
  joint.eventless = joint.friction[motor].smooth() && joint.friction[output].smooth() &&
                    joint.element_count == 0 && joint.obstacle.stiffness == 0;
  joint.inverse_ratio = 1 / joint.ratio;
  joint.mass = joint.output_inertia + joint.ratio * joint.ratio * joint.motor_inertia;
  const bool plain = joint.eventless && !joint.waves && joint.spring.wave_generator_stiffness == 0;
  joint.kind = !plain ? Kind::anything : joint.rigid ? Kind::smooth_rigid : Kind::smooth_mesh;
  const double n2 = joint.ratio * joint.ratio;
  joint.spread = joint.rigid ? 0 : 1 / joint.motor_inertia + n2 / joint.output_inertia;
  joint.inverse = {joint.rigid ? 0 : 1 / joint.motor_inertia,
                   1 / (joint.rigid ? joint.mass : joint.output_inertia)};
  return joint;
}

/// Inputs over a stretch without jumps: linear in time.
struct Inputs {
  double start = 0;   ///< s
  Ramp motor_torque;  ///< Nm
  Ramp load;          ///< Nm

  constexpr double motor_at(double t) const noexcept { return motor_torque.at(t - start); }
  constexpr double load_at(double t) const noexcept { return load.at(t - start); }
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
  NearSine hang;
  WaveSum error;  ///< kinematic error at these positions, where anything reads it
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
  BodyTorques on{};        ///< by springs and elements
  double spring = 0;       ///< τ at the wave generator
  double transmitted = 0;  ///< to the output: spring and hysteresis, without damping
};

/// Torques at frozen positions, without the friction of the bodies and structural damping.
struct Torques {
  BodyTorques on;
  double motor_torque;  ///< at the shaft, current ripple included
  double cogging;
  Within within;
  Outside outside;
};

/// The kinematic error of a compliant gear where `m` is.
inline WaveSum error_at(const Joint& joint, const Motion& m) noexcept {
  if (joint.rigid || joint.kinematic_error.empty()) return {};
  return sum(joint.kinematic_error, Angle<double>::from_radians(m.position[motor]).phase,
             Angle<double>::from_radians(m.position[output]).phase);
}

inline bool within_gear(const Element& element) noexcept {
  return element.along[motor] != 0 && element.along[output] != 0;
}

inline double stretch(const Element& element, const Motion& m) noexcept {
  const double error = within_gear(element) ? m.error.value : 0;
  return element.along[motor] * (m.position[motor] + error) +
         element.along[output] * m.position[output];
}

/// ∂y/∂θ and ∂y/∂q: what one Nm of the element does to each body.
inline std::array<double, 2> arms(const Element& element, const Motion& m) noexcept {
  if (!within_gear(element)) return element.along;
  return {element.along[motor] * (1 + m.error.by_motor),
          element.along[output] + element.along[motor] * m.error.by_output};
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

/// True where the gear is rigid.
template <Kind kind>
constexpr bool is_rigid(const Joint& joint) noexcept {
  if constexpr (kind == Kind::anything) return joint.rigid;
  return kind == Kind::smooth_rigid;
}

/// Gravity, given load, obstacle and ripple.
template <Kind kind>
inline Outside outside(const Joint& joint, const Inputs& in, double t, Motion& m,
                       Phase<double> theta, Phase<double> q) noexcept {
  Outside at{in.load_at(t)};
  if (joint.gravity != 0) {
    at.gravity = joint.gravity * near_sine(m.position[output] - joint.gravity_angle, m.hang);
  }
  if constexpr (kind != Kind::anything) return at;
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
template <Kind kind>
inline Within spring_torques(const Joint& joint, Motion& m) noexcept {
  if constexpr (kind == Kind::smooth_mesh) {
    const double windup = m.position[motor] - joint.ratio * m.position[output];
    const double torque = joint.spring.linear() ? windup * m.spring.stiffness
                                                : mesh_torque_of(joint.spring, windup, m.spring);
    const double transmitted = torque * joint.ratio;
    return {{-torque, transmitted}, torque, transmitted};
  }
  const WaveSum& error = m.error;
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
    const std::array<double, 2> arm = arms(element, m);
    at.on[motor] -= arm[motor] * torque;
    at.on[output] -= arm[output] * torque;
    if (within_gear(element)) at.transmitted -= arm[output] * torque;
  }
}

/// All torques at the positions of `m`; the neighbours of spring and gravity move along.
template <Kind kind = Kind::anything>
inline Torques torques(const Joint& joint, const Inputs& in, double t, Motion& m) noexcept {
  Phase<double> theta;
  Phase<double> q;
  double motor_torque = in.motor_at(t);
  double cogging = 0;
  const bool rigid = is_rigid<kind>(joint);
  if (kind == Kind::anything && joint.waves) {
    if (rigid) m.position[motor] = rigid_motor_angle(joint, m.position[output]);
    theta = Angle<double>::from_radians(m.position[motor]).phase;
    q = Angle<double>::from_radians(m.position[output]).phase;
    motor_torque += sum(joint.current_ripple, theta, q).value;
    cogging = sum(joint.cogging, theta, q).value;
  }
  Within within = rigid ? Within{} : spring_torques<kind>(joint, m);
  if constexpr (kind == Kind::anything) add_elements(joint, m, within);
  const Outside out = outside<kind>(joint, in, t, m, theta, q);
  const double driven = motor_torque - cogging;
  const double against = out.gravity + out.load + out.contact + out.ripple;
  return {standing_torques(rigid, joint.ratio, driven, within.on, against), motor_torque, cogging,
          within, out};
}

}  // namespace flexspline::batch::simulation
