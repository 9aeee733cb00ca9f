/// What instances of this project's MuJoCo plugins have in common: what they keep in mjData, and how
/// they read an MJCF. A sentence of what is wrong there goes to mju_warning.
#pragma once

#include <mujoco/mujoco.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <type_traits>

#include "flexspline/math.hpp"

namespace flexspline::mujoco {

static_assert(std::is_same_v<mjtNum, double>);

/// A plain struct as bits in plugin_state, where mj_resetData clears it, and mj_copyData,
/// mj_getState and mj_setState take it along.
template <typename Memory>
struct Kept {
  static_assert(std::is_trivially_copyable_v<Memory>);
  static constexpr int numbers = int((sizeof(Memory) + sizeof(mjtNum) - 1) / sizeof(mjtNum));

  static Memory read(const mjtNum* state) noexcept {
    Memory made;
    std::memcpy(static_cast<void*>(&made), state, sizeof made);
    return made;
  }

  /// Padding is written as zero, so that equal memories are equal bits.
  static void write(Memory memory, mjtNum* state) noexcept {
#if defined(__has_builtin)
#if __has_builtin(__builtin_clear_padding)
    __builtin_clear_padding(&memory);
#endif
#endif
    state[numbers - 1] = 0;
    std::memcpy(state, &memory, sizeof memory);
  }
};

/// One instance in one mjData.
template <typename Instance>
Instance* instance_of(const mjData* d, int instance) noexcept {
  return reinterpret_cast<Instance*>(d->plugin_data[instance]);
}

/// Makes one; returns what MuJoCo's `init` does.
template <typename Instance>
int keep(mjData* d, int instance, const Instance& made) {
  auto* kept = new (std::nothrow) Instance(made);
  d->plugin_data[instance] = reinterpret_cast<std::uintptr_t>(kept);
  return kept == nullptr ? -1 : 0;
}

/// What a plugin does with instances, whatever they are.
template <typename Instance>
void keep_instances(mjpPlugin& plugin) {
  plugin.destroy = [](mjData* d, int instance) {
    delete instance_of<Instance>(d, instance);
    d->plugin_data[instance] = 0;
  };
  plugin.copy = [](mjData* to, const mjModel*, const mjData* from, int instance) {
    *instance_of<Instance>(to, instance) = *instance_of<Instance>(from, instance);
  };
}

/// A passive force with attributes that live as long as the program; instances keep a Memory.
template <typename Settings, typename Instance, typename Memory, std::size_t N>
mjpPlugin passive(const char* const (&attributes)[N], int (*init)(const mjModel*, mjData*, int)) {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = Settings::name;
  plugin.nattribute = int(N);
  plugin.attributes = attributes;
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nstate = [](const mjModel*, int) { return Kept<Memory>::numbers; };
  plugin.init = init;
  keep_instances<Instance>(plugin);
  return plugin;
}

/// Whether another instance of the same plugin, made before, has this text at a key.
inline bool is_taken(const mjModel* m, int instance, const char* key, const char* text) {
  for (int other = 0; other < instance; ++other) {
    if (m->plugin[other] != m->plugin[instance]) continue;
    const char* theirs = mj_getPluginConfig(m, other, key);
    if (theirs != nullptr && std::strcmp(theirs, text) == 0) return true;
  }
  return false;
}

/// The hinge that an instance of plugin `whose` names at a key, which no other one does; its number
/// goes to `id`.
inline bool find_hinge(const mjModel* m, int instance, const char* whose, const char* key,
                       int& id) {
  const char* name = mj_getPluginConfig(m, instance, key);
  if (name == nullptr || *name == 0) {
    mju_warning("%s: the instance names no joint; give it a config with key=\"%s\"", whose, key);
    return false;
  }
  id = mj_name2id(m, mjOBJ_JOINT, name);
  if (id < 0) {
    mju_warning("%s: the model has no joint '%.200s'; give the config \"%s\" the name of one",
                whose, name, key);
    return false;
  }
  if (m->jnt_type[id] != mjJNT_HINGE) {
    mju_warning("%s: joint '%.200s' is no hinge; give one that is", whose, name);
    return false;
  }
  if (is_taken(m, instance, key, name)) {
    mju_warning("%s: two instances act on joint '%.200s'; take one away", whose, name);
    return false;
  }
  return true;
}

/// Whether a config has been given.
inline bool has_config(const mjModel* m, int instance, const char* key) {
  const char* text = mj_getPluginConfig(m, instance, key);
  return text != nullptr && *text != 0;
}

/// A finite number; without one `value` stays.
inline bool read_number(const mjModel* m, int instance, const char* key, double& value) {
  if (!has_config(m, instance, key)) return true;
  const char* text = mj_getPluginConfig(m, instance, key);
  char* end = nullptr;
  value = std::strtod(text, &end);
  return *end == 0 && math::is_finite(value);
}

/// "true" or "false"; without one false.
inline bool read_switch(const mjModel* m, int instance, const char* key, bool& on) {
  const char* text = mj_getPluginConfig(m, instance, key);
  on = text != nullptr && std::strcmp(text, "true") == 0;
  return on || text == nullptr || *text == 0 || std::strcmp(text, "false") == 0;
}

}  // namespace flexspline::mujoco
