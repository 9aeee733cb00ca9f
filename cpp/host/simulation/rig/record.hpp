/// What a simulation writes down at each row.
#pragma once

#include <string_view>

#include "host/simulation/rig/events.hpp"

namespace flexspline::batch::simulation {

/// Columns in the order of `Record::column`.
inline constexpr std::array<std::string_view, 30> column_names{
    "output_position",  "output_velocity",     "output_acceleration",   "motor_position",
    "motor_velocity",   "motor_torque",        "wave_generator_torque", "transmitted_torque",
    "link_torque",      "load_torque",         "contact_torque",        "gravity_torque",
    "motor_friction",   "output_friction",     "hysteresis_torque",     "motor_temperature",
    "body_temperature", "motor_stuck",         "output_stuck",          "stopped",
    "kinetic_energy",   "elastic_energy",      "gravity_energy",        "motor_work",
    "load_work",        "motor_friction_heat", "output_friction_heat",  "gear_heat",
    "obstacle_heat",    "copper_heat",
};

/// A column that is null is not written.
struct Record {
  std::array<double*, column_names.size()> column{};

  /// True where a column is wanted that needs the torques: all but angles and velocities.
  constexpr bool needs_torques() const noexcept {
    for (std::size_t k = 0; k < column.size(); ++k) {
      const bool plain = k == 0 || k == 1 || k == 3 || k == 4;
      if (!plain && column[k] != nullptr) return true;
    }
    return false;
  }
};

/// True where energy that went through is wanted, or heats something.
inline bool needs_work(const Joint& joint, const Record& record) noexcept {
  constexpr std::size_t first = 23;  // motor_work and what follows it
  static_assert(column_names[first] == "motor_work");
  bool wanted = joint.thermal.motor_capacity > 0 || joint.thermal.body_capacity > 0;
  for (std::size_t k = first; k < column_names.size(); ++k) {
    wanted = wanted || record.column[k] != nullptr;
  }
  return wanted;
}

/// Angles and velocities.
inline void write_motion(const Joint& joint, const Motion& m, std::size_t row,
                         const Record& record) noexcept {
  const double q = m.position[output];
  const double v = m.velocity[output];
  if (record.column[0] != nullptr) record.column[0][row] = q;
  if (record.column[1] != nullptr) record.column[1][row] = v;
  if (record.column[3] != nullptr) {
    record.column[3][row] = joint.rigid ? rigid_motor_angle(joint, q) : m.position[motor];
  }
  if (record.column[4] != nullptr) {
    record.column[4][row] = joint.rigid ? joint.ratio * v : m.velocity[motor];
  }
}

/// Energy stored in elements and obstacle.
inline double side_energy(const Joint& joint, const Motion& m) noexcept {
  double energy = 0;
  for (std::size_t j = 0; j < joint.element_count; ++j) {
    const double z = element_torque(joint, m, j);
    energy += z * z / (2 * joint.elements[j].stiffness);
  }
  if (m.contact) {
    const double depth = m.position[output] - joint.obstacle.angle;
    energy += joint.obstacle.stiffness * depth * depth / 2;
  }
  return energy;
}

inline double kinetic_energy(const Joint& joint, const Motion& m) noexcept {
  const double v = m.velocity[output];
  const double omega = joint.rigid ? joint.ratio * v : m.velocity[motor];
  return (joint.output_inertia * v * v + joint.motor_inertia * omega * omega) / 2;
}

inline double gravity_energy(const Joint& joint, const Motion& m) noexcept {
  const auto half =
      Angle<double>::from_radians((m.position[output] - joint.gravity_angle) / 2).phase.phasor();
  return 2 * joint.gravity * half.sine * half.sine;
}

/// Friction of a body: what slides, or what holds.
inline double friction_of(const Joint& joint, const Torques& at, const Slopes& f, const Motion& m,
                          std::size_t body) noexcept {
  return m.mode[body] != 0 ? f[body].friction : rest(joint, at, m, body).net;
}

inline double hysteresis_torque(const Joint& joint, const Motion& m) noexcept {
  double torque = 0;
  for (std::size_t j = 0; j < joint.element_count; ++j) torque += element_torque(joint, m, j);
  return torque;
}

/// Everything else, and the motion.
inline void write_all(const Joint& joint, const Inputs& in, double t, const Motion& now,
                      bool stopped, std::size_t row, const Record& record) noexcept {
  Motion m = now;
  const Torques at = torques(joint, in, t, m);
  const Slopes f = slopes(joint, at, m);
  const double v = m.velocity[output];
  const double a = f[output].acceleration;
  const double omega = joint.rigid ? joint.ratio * v : m.velocity[motor];
  const double theta =
      joint.rigid ? rigid_motor_angle(joint, m.position[output]) : m.position[motor];
  const double damped = joint.damping * (omega / joint.ratio - v);
  const double contact = at.outside.contact + at.outside.contact_damping * v;
  const double through =
      joint.rigid ? outer_load(at, m) + joint.output_inertia * a : at.within.transmitted + damped;
  const Work& w = m.work;
  const std::array<double, column_names.size()> values{
      m.position[output],
      v,
      a,
      theta,
      omega,
      at.motor_torque,
      joint.rigid ? through / joint.ratio : at.within.spring,
      through,
      at.outside.load + contact + at.outside.gravity + joint.link_inertia * a,
      at.outside.load + contact,
      contact,
      at.outside.gravity,
      joint.rigid ? 0 : friction_of(joint, at, f, m, motor),
      friction_of(joint, at, f, m, output),
      hysteresis_torque(joint, m),
      m.temperature[motor],
      m.temperature[output],
      !joint.rigid && m.mode[motor] == 0 ? 1.0 : 0.0,
      m.mode[output] == 0 ? 1.0 : 0.0,
      stopped ? 1.0 : 0.0,
      kinetic_energy(joint, m),
      stored_energy(joint.spring, joint.rigid ? 0 : at.within.spring) + side_energy(joint, m),
      gravity_energy(joint, m),
      w.motor,
      w.load,
      w.friction[motor],
      w.friction[output],
      w.gear,
      w.obstacle,
      w.copper};
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (record.column[k] != nullptr) record.column[k][row] = values[k];
  }
}

}  // namespace flexspline::batch::simulation
