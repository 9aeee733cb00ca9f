/// The gear between two hinges of MuJoCo, motor side and link: it twists, with backlash and
/// hysteresis, by the torsion part of a model. An engine plugin.
///
///   Δθ = Ñ (q − φ)                rad at the motor
///   qfrc_passive of the link's hinge  += τ,     of the motor's hinge  −= τ
///
/// τ: the torque that twists the model so far, Nm at the output (flexspline/coupling.hpp).
///
///   q    qpos of the link's hinge, config key "joint"
///   φ    qpos of the motor's hinge, config key "motor": it turns as the output would if nothing
///        twisted, θ/Ñ, so armature and actuators are those at the output, Ñ² and Ñ times those
///        of the shaft
///   temperature  °C, a constant of the instance, config key "temperature", held within the
///        range of the fit
///
/// Both hinges have the same axis, on bodies side by side with one parent; at q = φ nothing twists.
/// Actuators, the armature, and an instance of the plugin of the joint's friction belong to the
/// motor's hinge. Its body is to weigh next to nothing: an inertia at the output is no body's, and
/// as an armature it does not turn with the parent.
///
/// The loops' memory and τ, by which plugin_state begins, move on when MuJoCo integrates; reset and
/// copy take them along. Where an angle is not finite, the force is NaN, at which MuJoCo warns and
/// resets.
///
/// The force is that of the angles at the start of a step. Undamped, that holds for timesteps
///
///   h < 2 / sqrt(K (1/J_m + 1/J_l)),     K: largest stiffness, J: inertia at each hinge
///
/// and at a tenth of it the resonance is right to 0.2 %. A longer timestep is refused, for
/// the inertias in qpos0, each hinge with the other one free. MuJoCo's implicit integrators do
/// not help: they have derivatives of forces by velocity alone, and none of a plugin's.
#pragma once

#include <limits>
#include <type_traits>

#include "flexspline/coupling.hpp"
#include "mujoco-instance.hpp"

namespace flexspline::mujoco {

/// What `Settings` says is constant: `name` of the plugin, `model`, `coupling`, the `temperature`
/// [°C] where the MJCF gives none, the `coldest` and `warmest` of the fit.
template <typename Settings>
class CouplingPlugin {
 public:
  /// Makes the plugin known to MuJoCo, which calls it by the number that is returned.
  static int enter() {
    static constexpr const char* attributes[] = {"joint", "motor", "temperature"};
    mjpPlugin plugin = passive<Settings, Pair, Memory>(attributes, init);
    plugin.reset = [](const mjModel*, mjtNum* state, void* data, int) {
      auto& pair = *static_cast<Pair*>(data);
      pair.next = {};
      Kept<Memory>::write(pair.next, state);
    };
    plugin.compute = [](const mjModel* m, mjData* d, int instance, int) {
      Pair& pair = *instance_of<Pair>(d, instance);
      pair.next = Kept<Memory>::read(d->plugin_state + m->plugin_stateadr[instance]);
      pair.tell_of_long_step(m);
      Sample<double> at;
      at.temperature = math::clamp(pair.temperature, Settings::coldest, Settings::warmest);
      at.period = m->opt.timestep;
      at.time = d->time;
      const double torsion =
          Settings::coupling.ratio * (d->qpos[pair.link.position] - d->qpos[pair.motor.position]);
      const Status status = Settings::coupling.torque(Settings::model, at, torsion,
                                                      pair.next.effects, pair.next.torque);
      const double torque =
          status == Status::ok ? pair.next.torque : std::numeric_limits<double>::quiet_NaN();
      d->qfrc_passive[pair.link.dof] += torque;
      d->qfrc_passive[pair.motor.dof] -= torque;
    };
    plugin.advance = [](const mjModel* m, mjData* d, int instance) {
      const Pair& pair = *instance_of<Pair>(d, instance);
      Kept<Memory>::write(pair.next, d->plugin_state + m->plugin_stateadr[instance]);
    };
    return mjp_registerPlugin(&plugin);
  }

 private:
  using Model = std::remove_cvref_t<decltype(Settings::model)>;

  /// What a step keeps for the next one.
  struct Memory {
    double torque = 0;
    typename Model::State effects{};
  };

  struct Hinge {
    int id = 0, position = 0, dof = 0;
  };

  /// One instance in one mjData, and what the step that is under way found.
  struct Pair {
    Hinge link, motor;
    double temperature = Settings::temperature;
    double longest = 0;  ///< timestep, s
    bool told = false;
    Memory next{};

    /// Once, where the timestep was made longer since.
    void tell_of_long_step(const mjModel* m) noexcept {
      if (told || m->opt.timestep <= longest) return;
      told = true;
      warn_of_long_step(m, *this);
    }
  };

  static int init(const mjModel* m, mjData* d, int instance) {
    d->plugin_data[instance] = 0;
    Pair pair;
    if (!find(m, instance, "joint", pair.link) || !find(m, instance, "motor", pair.motor)) {
      return -1;
    }
    const char* name = mj_id2name(m, mjOBJ_JOINT, pair.link.id);
    if (pair.link.id == pair.motor.id) {
      mju_warning(
          "%s: joint '%.200s' is both link and motor; give the motor's side a hinge of its "
          "own",
          Settings::name, name);
      return -1;
    }
    if (!read_number(m, instance, "temperature", pair.temperature)) {
      mju_warning("%s: the temperature of joint '%.200s' is no number of deg C", Settings::name,
                  name);
      return -1;
    }
    const double lightness = m->dof_invweight0[pair.link.dof] + m->dof_invweight0[pair.motor.dof];
    pair.longest = 2 / mju_sqrt(Settings::coupling.stiffness() * lightness);
    if (m->opt.timestep > pair.longest) {
      warn_of_long_step(m, pair);
      return -1;
    }
    return keep(d, instance, pair);
  }

  static bool find(const mjModel* m, int instance, const char* key, Hinge& hinge) {
    if (!find_hinge(m, instance, Settings::name, key, hinge.id)) return false;
    hinge.position = m->jnt_qposadr[hinge.id];
    hinge.dof = m->jnt_dofadr[hinge.id];
    return true;
  }

  static void warn_of_long_step(const mjModel* m, const Pair& pair) {
    mju_warning(
        "%s: the gear of joint '%.200s' is up to %.3g Nm/rad stiff, and a timestep of %g s is too "
        "long for it; give one below %.2g s, better a tenth of that, or give both sides more "
        "inertia",
        Settings::name, mj_id2name(m, mjOBJ_JOINT, pair.link.id), Settings::coupling.stiffness(),
        m->opt.timestep, pair.longest);
  }
};

}  // namespace flexspline::mujoco
