/// The contract of an effect: what each header of this folder declares, and what generic code asks.
#pragma once

#include <concepts>
#include <tuple>
#include <utility>

#include "flexspline/row.hpp"

namespace flexspline {

/// What an effect is, beside its row. Generic code asks for these, never for a name; the laws over
/// the catalogue (tests/cpp/test_effects.cpp) hold each effect to what it declares.
struct Traits {
  bool constant = false;      ///< its row is the same for every sample
  bool basic = false;         ///< every drive has it: what a plain model of a joint consists of
  bool inertial = false;      ///< in proportion to the acceleration
  bool carries_load = false;  ///< part of the torque that the gear transmits, with the known load
  bool one_signed = false;    ///< all its coefficients have one sign: ≥ 0 where nothing is turned
  bool dissipative =
      false;                ///< with coefficients ≥ 0 it takes energy: over each step, or each loop
  bool loop = false;        ///< depends on the way that led there, not on how fast
  bool known_load = false;  ///< reads a load that is known from elsewhere, not the model's own
};

/// What a run must do to show an effect, beside having the channels that it reads.
enum class Excitation : unsigned char {
  both_directions,  ///< a tenth of the moving rows goes each way
  speed_ratio,      ///< fast rows are `amount` times as fast as slow ones
  low_speeds,       ///< some rows move at less than a fifth of the top speed
  acceleration,     ///< the acceleration is well above its noise
  turn,             ///< the output covers this share of a turn
  resolved_order,   ///< the rate resolves `amount` periods per turn of the motor
  resolved_poles,   ///< the rate resolves a period per pair of poles of the motor
  temperature,      ///< it changes by `amount` K
  duration,         ///< the run lasts `amount` s
  known_load,       ///< a known torque changes
  any_load,         ///< a known torque changes, or the joint moves its own mass
  both_torques,     ///< a known torque takes both signs
  there_and_back,   ///< the load rises and falls
  motor_torque,     ///< the drive's torque changes
};

struct Demand {
  Excitation excitation;
  double amount = 0;
};

/// What of an effect may be left out, with what it is then: `paths`, none; `reversal`, what it does
/// at a reversal in a few words, nothing; `combines`, the effects whose columns it has together,
/// none.
template <typename Effect>
constexpr auto paths_of() noexcept {
  if constexpr (requires { Effect::paths; }) {
    return Effect::paths;
  } else {
    return std::array<Path, 0>{};
  }
}
template <typename Effect>
constexpr std::string_view reversal_of() noexcept {
  if constexpr (requires { Effect::reversal; }) {
    return Effect::reversal;
  } else {
    return {};
  }
}
template <typename Effect>
constexpr auto combines_of() noexcept {
  if constexpr (requires { Effect::combines; }) {
    return Effect::combines;
  } else {
    return std::array<std::string_view, 0>{};
  }
}

/// The row of an effect, with its memory where it has one.
template <typename S, typename Effect>
constexpr auto row_of(const Effect& effect, const Sample<S>& at,
                      [[maybe_unused]] StateOf<Effect>& state) noexcept {
  if constexpr (Remembers<Effect>) {
    return effect.row(at, state);
  } else {
    return effect.row(at);
  }
}

/// How many terms an effect's row has at most.
template <typename S, typename Effect>
inline constexpr std::size_t width_of = std::tuple_size_v<decltype(row_of(
    std::declval<const Effect&>(), std::declval<const Sample<S>&>(),
    std::declval<StateOf<Effect>&>()))>;

template <typename Effect>
constexpr bool reads(Channel channel) noexcept {
  for (const Channel c : Effect::reads) {
    if (c == channel) return true;
  }
  return false;
}

template <typename Effect>
concept HarmonicEffect = requires(const Effect& effect) { effect.harmonics(); };

/// Harmonics whose amplitude and phase speed changes: their rows are more than cosines and sines.
template <typename Effect>
concept ModulatedHarmonicEffect =
    HarmonicEffect<Effect> && requires(const Effect& effect) { effect.modulated({}, 1, {}); };

/// Effects that make up the transmitted torque beside the known load.
template <typename Effect>
concept CarriesLoad = Effect::traits.carries_load;

/// Whether a unit is one that model files and effects of a user's own have: a product of powers,
/// and what it is divided by, such as Nm·s²/rad² or rad/(Nm·K).
consteval bool is_unit(std::string_view unit) {
  const auto take = [&unit](std::string_view text) {
    const bool there = unit.starts_with(text);
    if (there) unit.remove_prefix(text.size());
    return there;
  };
  const auto factor = [&take] {
    for (const std::string_view symbol :
         {"1", "Nm", "rad", "s", "K", "°C", "A", "V", "kg", "m", "N"}) {
      if (take(symbol)) return take("²") || take("³") || true;
    }
    return false;
  };
  const auto product = [&take, &factor] {
    bool good = factor();
    while (good && take("·")) good = factor();
    return good;
  };
  bool good = product();
  if (good && take("/")) good = take("(") ? product() && take(")") : factor();
  return good && unit.empty();
}

/// Whether an effect says what it is, of what targets, in what units.
template <typename Effect>
consteval bool described() {
  bool all = !Effect::name.empty() && !Effect::signature.empty() && !Effect::source.empty() &&
             !Effect::targets.empty() && !Effect::terms.empty();
  all &= Effect::targets.find_first_not_of("SMD") == Effect::targets.npos;
  for (const Term& term : Effect::terms) {
    all &= !term.name.empty() && !term.unit.empty() && is_unit(term.unit);
  }
  return all;
}

/// Whether the traits of an effect fit together, and what it reads.
template <typename Effect>
consteval bool consistent() {
  constexpr Traits is = Effect::traits;
  constexpr bool by_load = reads<Effect>(Channel::load);
  bool all = !is.constant || Effect::reads.empty();
  all &= !is.inertial || reads<Effect>(Channel::output_acceleration);
  all &= !is.carries_load || (!by_load && !Remembers<Effect>);  // made once, before any row
  all &= !is.loop || Remembers<Effect>;
  all &= !is.dissipative || is.one_signed;
  all &= !is.known_load || by_load;
  for (const Path& path : paths_of<Effect>()) all &= reads<Effect>(path.channel);
  return all;
}

/// An effect: what it says of itself, and its row of the terms that its coefficients multiply.
template <typename Effect, typename S>
concept PhysicalEffect =
    std::default_initializable<Effect> &&
    requires(const Effect& effect, const Sample<S>& at, StateOf<Effect>& state) {
      { Effect::name } -> std::convertible_to<std::string_view>;
      { Effect::targets } -> std::convertible_to<std::string_view>;
      { Effect::signature } -> std::convertible_to<std::string_view>;
      { Effect::source } -> std::convertible_to<std::string_view>;
      { Effect::traits } -> std::convertible_to<Traits>;
      { Effect::terms[0] } -> std::convertible_to<Term>;
      { Effect::demands.data() } -> std::convertible_to<const Demand*>;
      { Effect::reads.data() } -> std::convertible_to<const Channel*>;
      { row_of<S>(effect, at, state) } noexcept;
    } && (HarmonicEffect<Effect> || width_of<S, Effect> == Effect::terms.size()) &&
    (!Remembers<Effect> || requires(const Effect& effect, const StateOf<Effect>& state) {
      { effect.settled(state) } noexcept -> std::same_as<bool>;
    }) && described<Effect>() && consistent<Effect>();

}  // namespace flexspline
