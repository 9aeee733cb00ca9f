/// A model of a joint as the passive force of a MuJoCo joint: an engine plugin.
///
///   qfrc_passive −= k · τ(q, q̇, q̈, load, temperature, time)      at the joint's degree of freedom
///
/// τ: what the exported model says that the joint takes beside its load, in the unit of its target;
/// k: Nm at the output that such a unit is worth. A friction above zero opposes the motion.
///
///   q, q̇          qpos and qvel of this step, rad and rad/s; q has the zero of the logs
///   θ             Ñ q, where the model reads the motor's angle
///   q̈             qacc of the step before
///   load          what the gear transmits, Nm, outward: qfrc_actuator and this force, both of the
///                 step before, for MuJoCo asks for passive forces ahead of all others
///   motor torque  qfrc_actuator / Ñ of the step before
///   temperature   °C, a constant of the instance: config key "temperature"
///   period, time  opt.timestep and mjData.time
///
/// In the first step what is of the step before is zero.
///
/// The memory of effects that have one, q̈ and the load are in mjData's plugin_state, as bits and not
/// as numbers: mj_resetData clears them, and mj_copyData, mj_getState and mj_setState take them
/// along. They move on when MuJoCo integrates: mj_forward, however often, and the stages of a
/// Runge–Kutta step change nothing. Where the model cannot say a torque, because a channel is not
/// finite, the force is NaN, at which MuJoCo warns and resets.
///
/// The force is explicit: friction, which changes sign over ±v_d rad/s (direction_width), chatters
/// at standstill unless the timestep is below 2 M / (dτ/dv), M the joint's inertia. Loading a model
/// with a longer one warns and gives that number, for the largest load at standstill that the fit
/// knows. A narrower v_d holds a load better and takes a shorter step: below the level of friction
/// the joint creeps at less than v_d. flexspline's own forward simulation takes v_d to zero.
#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <type_traits>

#include "flexspline/model.hpp"

namespace flexspline::mujoco {

/// What `Settings` says is constant: `name` of the plugin, `model`, `torque` k, `ratio` Ñ, the
/// `temperature` [°C] where the MJCF gives none, and the largest `load` [Nm] at rest. The instance
/// names the joint: config key "joint".
template <typename Settings>
class JointPlugin {
 public:
  /// Makes the plugin known to MuJoCo.
  static void enter() {
    static constexpr const char* attributes[] = {"joint", "temperature"};
    mjpPlugin plugin;
    mjp_defaultPlugin(&plugin);
    plugin.name = Settings::name;
    plugin.nattribute = 2;
    plugin.attributes = attributes;
    plugin.capabilityflags = mjPLUGIN_PASSIVE;
    plugin.nstate = [](const mjModel*, int) { return numbers_of_memory; };
    plugin.init = init;
    plugin.destroy = [](mjData* d, int instance) {
      delete of(d, instance);
      d->plugin_data[instance] = 0;
    };
    plugin.copy = [](mjData* to, const mjModel*, const mjData* from, int instance) {
      *of(to, instance) = *of(from, instance);
    };
    plugin.reset = [](const mjModel*, mjtNum* state, void* data, int) {
      auto& joint = *static_cast<Joint*>(data);
      joint.next = {};
      joint.force = 0;
      write(joint.next, state);
    };
    plugin.compute = [](const mjModel* m, mjData* d, int instance, int) {
      Joint& joint = *of(d, instance);
      joint.next = read(d->plugin_state + m->plugin_stateadr[instance]);
      joint.force = -Settings::torque * taken(m->opt.timestep, *d, joint, joint.next);
      d->qfrc_passive[joint.dof] += joint.force;
    };
    plugin.advance = [](const mjModel* m, mjData* d, int instance) {
      Joint& joint = *of(d, instance);
      joint.next.acceleration = d->qacc[joint.dof];
      joint.next.actuators = d->qfrc_actuator[joint.dof];
      joint.next.load = joint.next.actuators + joint.force;
      write(joint.next, d->plugin_state + m->plugin_stateadr[instance]);
    };
    mjp_registerPlugin(&plugin);
  }

 private:
  using Model = std::remove_cvref_t<decltype(Settings::model)>;
  static_assert(std::is_same_v<mjtNum, double>);

  /// What a step keeps for the next one.
  struct Memory {
    double acceleration = 0, actuators = 0, load = 0;
    typename Model::State effects{};
  };
  static_assert(std::is_trivially_copyable_v<Memory>);
  static constexpr int numbers_of_memory =
      int((sizeof(Memory) + sizeof(mjtNum) - 1) / sizeof(mjtNum));

  /// One instance in one mjData: its joint, and what the step that is under way found.
  struct Joint {
    int position = 0, dof = 0;
    double temperature = Settings::temperature;
    Memory next{};
    double force = 0;
  };

  static Joint* of(const mjData* d, int instance) noexcept {
    return reinterpret_cast<Joint*>(d->plugin_data[instance]);
  }

  static Memory read(const mjtNum* state) noexcept {
    Memory made;
    std::memcpy(&made, state, sizeof made);
    return made;
  }

  /// Padding is written as zero, so that equal memories are equal bits.
  static void write(Memory memory, mjtNum* state) noexcept {
#if defined(__has_builtin)
#if __has_builtin(__builtin_clear_padding)
    __builtin_clear_padding(&memory);
#endif
#endif
    state[numbers_of_memory - 1] = 0;
    std::memcpy(state, &memory, sizeof memory);
  }

  /// τ of this instant, NaN where the model cannot say; `memory` moves on by a step.
  static double taken(double period, const mjData& d, const Joint& joint, Memory& memory) noexcept {
    Sample<double> at;
    at.output_position = Angle<double>::from_radians(d.qpos[joint.position]);
    at.output_velocity = d.qvel[joint.dof];
    at.output_acceleration = memory.acceleration;
    at.temperature = joint.temperature;
    at.known_load = memory.load;
    at.motor_torque = memory.actuators / Settings::ratio;
    at.period = period;
    at.time = d.time;
    double torque = std::numeric_limits<double>::quiet_NaN();
    const Status status = evaluation::predict(Settings::model, at, memory.effects, torque);
    return status == Status::ok ? torque : std::numeric_limits<double>::quiet_NaN();
  }

  static int init(const mjModel* m, mjData* d, int instance) {
    d->plugin_data[instance] = 0;
    Joint joint;
    const char* name = mj_getPluginConfig(m, instance, "joint");
    if (name == nullptr || *name == 0) {
      mju_warning("%s: the instance names no joint; give it a config with key=\"joint\"",
                  Settings::name);
      return -1;
    }
    const int id = mj_name2id(m, mjOBJ_JOINT, name);
    if (id < 0) {
      mju_warning("%s: the model has no joint '%.200s'; give the config \"joint\" the name of one",
                  Settings::name, name);
      return -1;
    }
    if (m->jnt_type[id] != mjJNT_HINGE) {
      mju_warning("%s: joint '%.200s' is no hinge; give one that is", Settings::name, name);
      return -1;
    }
    if (is_taken(m, instance, name)) {
      mju_warning("%s: two instances act on joint '%.200s'; take one away", Settings::name, name);
      return -1;
    }
    if (!read_temperature(mj_getPluginConfig(m, instance, "temperature"), joint.temperature)) {
      mju_warning("%s: the temperature of joint '%.200s' is no number of deg C", Settings::name,
                  name);
      return -1;
    }
    joint.position = m->jnt_qposadr[id];
    joint.dof = m->jnt_dofadr[id];
    warn_of_chatter(m, joint, name);
    auto* kept = new (std::nothrow) Joint(joint);
    d->plugin_data[instance] = reinterpret_cast<std::uintptr_t>(kept);
    return kept == nullptr ? -1 : 0;
  }

  static bool is_taken(const mjModel* m, int instance, const char* name) {
    for (int other = 0; other < instance; ++other) {
      if (m->plugin[other] != m->plugin[instance]) continue;
      const char* theirs = mj_getPluginConfig(m, other, "joint");
      if (theirs != nullptr && std::strcmp(theirs, name) == 0) return true;
    }
    return false;
  }

  static bool read_temperature(const char* text, double& temperature) {
    if (text == nullptr || *text == 0) return true;
    char* end = nullptr;
    temperature = std::strtod(text, &end);
    return *end == 0 && math::is_finite(temperature);
  }

  /// Whether friction can change sign faster than a step lets it, which MuJoCo's user is told.
  static void warn_of_chatter(const mjModel* m, const Joint& joint, const char* name) {
    constexpr double slow = 1e-5;  // rad/s, below all that a change of direction takes
    const auto at = [&](double velocity) {
      Sample<double> sample;
      sample.output_position = Angle<double>::from_radians(m->qpos0[joint.position]);
      sample.output_velocity = velocity;
      sample.temperature = joint.temperature;
      sample.known_load = Settings::load;
      sample.period = m->opt.timestep;
      typename Model::State none{};
      double torque = 0;
      (void)evaluation::predict(Settings::model, sample, none, torque);
      return torque;
    };
    const double slope = Settings::torque * (at(slow) - at(-slow)) / (2 * slow);
    const double longest = 2 * m->dof_M0[joint.dof] / slope;
    if (slope > 0 && m->opt.timestep > longest) {
      mju_warning(
          "%s: friction of joint '%.200s' will chatter at standstill with a timestep of %g s; give "
          "one below %.2g s",
          Settings::name, name, m->opt.timestep, longest);
    }
  }
};

}  // namespace flexspline::mujoco
