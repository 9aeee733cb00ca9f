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
///   temperature   °C, config key "temperature": a constant, or where a joint that its losses heat
///                 starts
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
/// The force is that of q̇ at the start of the step: friction, which changes sign over ±v_d rad/s
/// (direction_width), chatters at standstill unless the timestep h is below 2 M / (k dτ/dv), M the
/// joint's inertia. Loading a model with a longer one warns and gives that number, for the largest
/// load at standstill that the fit knows. Below the level of friction the joint creeps at less than
/// v_d; flexspline's own forward simulation takes v_d to zero.
///
/// With the config key "implicit" at "true" the force is that of u, the velocity at the end of the
/// step, and any timestep will do:
///
///   u = q̇ + (F − k τ(u)) h / A,    F = A q̈ + k τ of the step before
///
/// A: the joint's armature, no more than what truly moves with it, at which this is stable. Not for
/// Runge–Kutta, whose stages are no steps. plugin_state begins with u, or q̇, for which the force is.
///
/// With the config keys "thermal_resistance" R [K/W] and "thermal_time_constant" t_c [s], both of
/// them, friction heats the joint and its heat goes to the room, "ambient" [°C], by default where it
/// starts (flexspline/self_heating.hpp):
///
///   R C = t_c,   C dT/dt = P − (T − T_a)/R,   P = −F u at the joint, over the step
///
/// P is what this force takes: no losses of windings, and what springs and cogging give back counts
/// against what they took. The model sees T no further than the range that it was fitted in, beyond
/// which a polynomial may let friction drive. plugin_state[4] is T less "temperature", in K.
#pragma once

#include <limits>
#include <type_traits>

#include "flexspline/find_zero.hpp"
#include "flexspline/model.hpp"
#include "flexspline/self_heating.hpp"
#include "mujoco-instance.hpp"

namespace flexspline::mujoco {

/// What `Settings` says is constant: `name` of the plugin, `model`, `torque` k, `ratio` Ñ, the
/// `temperature` [°C] where the MJCF gives none, the `coldest` and `warmest` of the fit, and the
/// largest `load` [Nm] at rest. The instance names the joint: config key "joint".
template <typename Settings>
class JointPlugin {
 public:
  /// Makes the plugin known to MuJoCo, which calls it by the number that is returned.
  static int enter() {
    static constexpr const char* attributes[] = {
        "joint",   "temperature",        "implicit",
        "ambient", "thermal_resistance", "thermal_time_constant"};
    mjpPlugin plugin = passive<Settings, Joint, Memory>(attributes, init);
    plugin.reset = [](const mjModel*, mjtNum* state, void* data, int) {
      auto& joint = *static_cast<Joint*>(data);
      joint.next = {};
      joint.force = 0;
      Kept<Memory>::write(joint.next, state);
    };
    plugin.compute = [](const mjModel* m, mjData* d, int instance, int) {
      Joint& joint = *instance_of<Joint>(d, instance);
      const Memory before = Kept<Memory>::read(d->plugin_state + m->plugin_stateadr[instance]);
      const Step step{*d, joint, before, m->opt.timestep, m->dof_armature[joint.dof]};
      joint.next = before;
      joint.next.velocity = joint.implicit ? step.ends_with() : d->qvel[joint.dof];
      joint.force = step.force(joint.next.velocity, joint.next.effects);
      d->qfrc_passive[joint.dof] += joint.force;
    };
    plugin.advance = [](const mjModel* m, mjData* d, int instance) {
      Joint& joint = *instance_of<Joint>(d, instance);
      joint.next.acceleration = d->qacc[joint.dof];
      joint.next.actuators = d->qfrc_actuator[joint.dof];
      joint.next.load = joint.next.actuators + joint.force;
      if (joint.heated) {
        const double loss = -joint.force * joint.next.velocity;
        (void)joint.heating.step(loss, m->opt.timestep, joint.next.warmer);
      }
      Kept<Memory>::write(joint.next, d->plugin_state + m->plugin_stateadr[instance]);
    };
    return mjp_registerPlugin(&plugin);
  }

 private:
  using Model = std::remove_cvref_t<decltype(Settings::model)>;

  /// What a step keeps for the next one.
  struct Memory {
    double velocity = 0, acceleration = 0, actuators = 0, load = 0, warmer = 0;
    typename Model::State effects{};
  };

  /// One instance in one mjData: its joint, and what the step that is under way found.
  struct Joint {
    int position = 0, dof = 0;
    double temperature = Settings::temperature;
    bool implicit = false;
    bool heated = false;
    SelfHeating<double> heating{};  ///< temperatures counted from `temperature`
    Memory next{};
    double force = 0;

    /// What the model reads, °C, with a joint warmer than at its start by `warmer`.
    double temperature_read(double warmer) const noexcept {
      if (!heated) return temperature;
      return math::clamp(temperature + warmer, Settings::coldest, Settings::warmest);
    }
  };

  static constexpr int most_trials = 60;
  static constexpr double tolerance = 1e-10;  ///< rad/s, of the velocity at the end of a step

  /// A step of MuJoCo before it is made: the force by the velocity, and the velocity at its end.
  struct Step {
    const mjData& d;
    const Joint& joint;
    const Memory& before;
    double period, armature;

    /// −k τ, NaN where the model cannot say; `effects`, as they were before, move on by the step.
    double force(double velocity, typename Model::State& effects) const noexcept {
      Sample<double> at;
      at.output_position = Angle<double>::from_radians(d.qpos[joint.position]);
      at.output_velocity = velocity;
      at.output_acceleration = before.acceleration;
      at.temperature = joint.temperature_read(before.warmer);
      at.known_load = before.load;
      at.motor_torque = before.actuators / Settings::ratio;
      at.period = period;
      at.time = d.time;
      double torque = std::numeric_limits<double>::quiet_NaN();
      const Status status = evaluation::predict(Settings::model, at, effects, torque);
      return status == Status::ok ? -Settings::torque * torque
                                  : std::numeric_limits<double>::quiet_NaN();
    }

    /// u = q̇ + (F − k τ(u)) h / A. Where friction grows with speed the explicit step ends too far,
    /// and u lies between; where it falls, the next such step is nearer to u.
    double ends_with() const noexcept {
      const double scale = period / armature;
      const double pull = armature * before.acceleration - (before.load - before.actuators);
      const double start = d.qvel[joint.dof];
      const auto missing = [&](double velocity) {
        typename Model::State unused = before.effects;
        const double more = start + scale * (pull + force(velocity, unused)) - velocity;
        return math::absolute(more) <= tolerance ? 0.0 : more;
      };
      double low = start, at_low = missing(low);
      double high = start + at_low, at_high = missing(high);
      for (int k = 0; k < most_trials && at_low * at_high > 0; ++k) {
        low = high;
        at_low = at_high;
        high += at_high;
        at_high = missing(high);
      }
      if (!(at_low * at_high < 0)) return at_low == 0 ? low : high;
      if (at_low > 0) return find_zero(missing, low, at_low, high, at_high, 0.0);
      return find_zero(missing, high, at_high, low, at_low, 0.0);
    }
  };

  static int init(const mjModel* m, mjData* d, int instance) {
    d->plugin_data[instance] = 0;
    Joint joint;
    int id = 0;
    if (!find_hinge(m, instance, Settings::name, "joint", id)) return -1;
    const char* name = mj_id2name(m, mjOBJ_JOINT, id);
    joint.position = m->jnt_qposadr[id];
    joint.dof = m->jnt_dofadr[id];
    if (!read_number(m, instance, "temperature", joint.temperature)) {
      mju_warning("%s: the temperature of joint '%.200s' is no number of deg C", Settings::name,
                  name);
      return -1;
    }
    if (!read_switch(m, instance, "implicit", joint.implicit)) {
      mju_warning("%s: implicit of joint '%.200s' is neither true nor false", Settings::name, name);
      return -1;
    }
    if (joint.implicit && !(m->dof_armature[joint.dof] > 0)) {
      mju_warning("%s: an implicit force needs an armature of joint '%.200s' above zero",
                  Settings::name, name);
      return -1;
    }
    if (!read_heating(m, instance, name, joint)) return -1;
    if (!joint.implicit) warn_of_chatter(m, joint, name);
    return keep(d, instance, joint);
  }

  static bool read_heating(const mjModel* m, int instance, const char* name, Joint& joint) {
    const bool resists = has_config(m, instance, "thermal_resistance");
    const bool lasts = has_config(m, instance, "thermal_time_constant");
    joint.heated = resists && lasts;
    if (resists != lasts) {
      mju_warning(
          "%s: joint '%.200s' has one of thermal_resistance and thermal_time_constant; "
          "give both, or none",
          Settings::name, name);
      return false;
    }
    if (!joint.heated && has_config(m, instance, "ambient")) {
      mju_warning(
          "%s: ambient of joint '%.200s' needs a thermal_resistance and a "
          "thermal_time_constant; give them, or leave it out",
          Settings::name, name);
      return false;
    }
    double room = joint.temperature;
    bool good = true;
    const auto read = [&](const char* key, const char* what, double least, double& value) {
      if (good && (!read_number(m, instance, key, value) || !(value >= least))) {
        mju_warning("%s: %s of joint '%.200s' is no %s", Settings::name, key, name, what);
        good = false;
      }
    };
    using Limits = std::numeric_limits<double>;
    read("ambient", "number of deg C", Limits::lowest(), room);
    read("thermal_resistance", "number of K/W from zero on", 0, joint.heating.resistance);
    read("thermal_time_constant", "number of s above zero", Limits::min(),
         joint.heating.time_constant);
    joint.heating.ambient = room - joint.temperature;
    return good;
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
          "one below %.2g s, or the config \"implicit\" the value \"true\"",
          Settings::name, name, m->opt.timestep, longest);
    }
  }
};

}  // namespace flexspline::mujoco
