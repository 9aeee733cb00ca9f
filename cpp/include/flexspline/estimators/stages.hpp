/// The stages of a chain: which there are, and which of them a joint has. `for_each_stage` is the one
/// list of them: parameters that change in the field, and on a PC bindings, exported header and block,
/// follow from it.
///
/// A chain reads its stages from the fields of any struct. A field that is a stage always runs; an
/// `std::optional` of one runs where it has a value (`AnyStages`: chosen at run time); one that is
/// `Absent` never does, and costs neither code nor time. An exported header derives from `NoStages`
/// and has its own stages as fields, which hide those that are absent.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "flexspline/estimators/adaptation.hpp"
#include "flexspline/estimators/calibration.hpp"
#include "flexspline/estimators/collision_detector.hpp"
#include "flexspline/estimators/compliance.hpp"
#include "flexspline/estimators/differentiator.hpp"
#include "flexspline/estimators/kalman_merge.hpp"
#include "flexspline/estimators/load_hysteresis.hpp"
#include "flexspline/estimators/momentum_observer.hpp"
#include "flexspline/estimators/temperature_compensation.hpp"
#include "flexspline/estimators/thermistor.hpp"
#include "flexspline/reading_checks.hpp"

namespace flexspline {

/// A stage of the chain, as a bit.
enum class Stage : std::uint16_t {
  none = 0,
  thermistor = 1,
  compensation = 2,
  sensor = 4,
  observer = 8,
  compliance = 16,
  merge = 32,
  collision = 64,
  compliant_observer = 128,
  differentiator = 256,
};

constexpr Stage operator|(Stage a, Stage b) noexcept {
  return static_cast<Stage>(static_cast<std::uint16_t>(a) | static_cast<std::uint16_t>(b));
}
/// Whether `stages` has the bit of `wanted`.
constexpr bool has(Stage stages, Stage wanted) noexcept {
  return (static_cast<std::uint16_t>(stages) & static_cast<std::uint16_t>(wanted)) != 0;
}

/// Which torque drives the observer.
enum class ObserverInput : unsigned char { sensor_torque, motor_torque };

/// Which external torque the merge takes at rest.
enum class AtRest : unsigned char { compliance, compliant_observer };

/// Which external torque the collision detector watches.
enum class Watched : unsigned char { observer, sensor, merged, compliant_observer };

/// A stage that is never there.
template <typename Stage>
struct Absent {};

template <typename T>
inline constexpr bool is_absent = false;
template <typename T>
inline constexpr bool is_absent<const Absent<T>> = true;

/// The stage, or null where it does not run.
template <typename T>
constexpr T* given(T& stage) noexcept {
  return &stage;
}
template <typename T>
constexpr T* given(std::optional<T>& stage) noexcept {
  return stage ? &*stage : nullptr;
}
template <typename T>
constexpr const T* given(const std::optional<T>& stage) noexcept {
  return stage ? &*stage : nullptr;
}
template <typename T>
constexpr const T* given(const Absent<T>&) noexcept {
  return nullptr;
}

/// Whether a stage runs; known to the compiler but for an optional one.
template <typename T>
constexpr bool runs(const T&) noexcept {
  return !is_absent<const T>;
}
template <typename T>
constexpr bool runs(const std::optional<T>& stage) noexcept {
  return stage.has_value();
}

/// A chain of nothing.
template <typename S>
struct NoStages {
  static constexpr Absent<typename ReadingChecks<S>::Config> checks{};
  static constexpr Absent<typename Differentiator<S>::Config> differentiator{};
  static constexpr Absent<Thermistor<S>> thermistor{};
  static constexpr Absent<typename TemperatureCompensation<S, 1>::Config> compensation{};
  static constexpr bool sensor = false;
  static constexpr Absent<Calibration<S>> calibration{};
  static constexpr Absent<typename MomentumObserver<S>::Config> observer{};
  static constexpr ObserverInput observer_input = ObserverInput::sensor_torque;
  static constexpr Absent<Compliance<S>> compliance{};
  static constexpr Absent<LoadHysteresis<S>> hysteresis{};
  static constexpr Absent<typename MomentumObserver<S>::Config> compliant_observer{};
  static constexpr Absent<LogisticMerge<S>> logistic{};
  static constexpr Absent<typename KalmanMerge<S>::Config> kalman{};
  static constexpr AtRest at_rest = AtRest::compliance;
  static constexpr Absent<typename CollisionDetector<S, 1>::Config> collision{};
  static constexpr Watched watched = Watched::observer;
  static constexpr Absent<typename Adaptation<S, 1>::Config> adaptation{};
};

/// Any stages, chosen at run time. A stage without a value does not run.
template <typename S>
struct AnyStages {
  std::optional<typename ReadingChecks<S>::Config> checks;
  /// Without: velocity and acceleration are channels.
  std::optional<typename Differentiator<S>::Config> differentiator;
  std::optional<Thermistor<S>> thermistor;  ///< without: the temperature is a channel
  std::optional<typename TemperatureCompensation<S>::Config> compensation;
  bool sensor = false;
  std::optional<Calibration<S>> calibration;  ///< without: the sensor torque is a channel
  std::optional<typename MomentumObserver<S>::Config> observer;
  ObserverInput observer_input = ObserverInput::sensor_torque;
  std::optional<Compliance<S>> compliance;
  std::optional<LoadHysteresis<S>> hysteresis;  ///< of the compliance
  std::optional<typename MomentumObserver<S>::Config> compliant_observer;
  std::optional<LogisticMerge<S>> logistic;
  std::optional<typename KalmanMerge<S>::Config> kalman;  ///< comes before `logistic`
  AtRest at_rest = AtRest::compliance;
  std::optional<typename CollisionDetector<S>::Config> collision;
  Watched watched = Watched::observer;
  std::optional<typename Adaptation<S>::Config> adaptation;  ///< of the observer's model
};

/// What a stage is called.
struct StageInfo {
  std::string_view key;       ///< in model.json, and among the parameters that change in the field
  std::string_view member;    ///< of the chain
  std::string_view type;      ///< in an exported header; {key}: how many values the entry has there
  Stage bit = Stage::none;    ///< says that it missed
  std::string_view within{};  ///< the entry of model.json that holds it, where that is another's
};

/// A choice that a chain makes between its stages, by the entry of one of them in model.json.
template <typename Enum, std::size_t N>
struct Choice {
  std::string_view key;     ///< in the entry
  std::string_view member;  ///< of the chain
  std::string_view type;    ///< of the enumerators, in an exported header
  std::string_view prefix;
  std::array<std::string_view, N> structure;  ///< prefix and word, in the enumerators' order

  constexpr std::string_view word(std::size_t k) const noexcept {
    return structure[k].substr(prefix.size());
  }
};

inline constexpr Choice<ObserverInput, 2> observer_inputs{
    "input", "observer_input", "ObserverInput", "by ", {"by sensor_torque", "by motor_torque"}};
inline constexpr Choice<AtRest, 2> at_rests{"at_rest",
                                            "at_rest",
                                            "AtRest",
                                            "at rest ",
                                            {"at rest compliance", "at rest compliant_observer"}};
inline constexpr Choice<Watched, 4> watched_ones{
    "input",
    "watched",
    "Watched",
    "watches ",
    {"watches observer", "watches sensor", "watches merged", "watches compliant_observer"}};

/// All stages of a chain, of whatever struct, in the order of their parameters:
///
///   use(info, stage)               the stage may be absent, or an optional; `sensor` is a bool
///   choose(choice, value, asked)   behind the stages whose choice it is; asked: one of them runs
template <typename Chain, typename Use, typename Choose>
constexpr void for_each_stage(Chain& chain, Use&& use, Choose&& choose) {
  use(StageInfo{"reading_checks", "checks", "typename flexspline::ReadingChecks<S>::Config"},
      chain.checks);
  use(StageInfo{"differentiator", "differentiator",
                "typename flexspline::Differentiator<S>::Config", Stage::differentiator},
      chain.differentiator);
  use(StageInfo{"thermistor", "thermistor", "flexspline::Thermistor<S>", Stage::thermistor},
      chain.thermistor);
  use(StageInfo{"temperature_compensation", "compensation",
                "typename flexspline::TemperatureCompensation<S, {coefficients}>::Config",
                Stage::compensation},
      chain.compensation);
  use(StageInfo{"sensor", "sensor", "bool", Stage::sensor}, chain.sensor);
  use(StageInfo{"calibration", "calibration", "flexspline::Calibration<S>"}, chain.calibration);
  use(StageInfo{"observer", "observer", "typename flexspline::MomentumObserver<S>::Config",
                Stage::observer},
      chain.observer);
  choose(observer_inputs, chain.observer_input, runs(chain.observer));
  use(StageInfo{"compliance", "compliance", "flexspline::Compliance<S>", Stage::compliance},
      chain.compliance);
  use(StageInfo{"hysteresis", "hysteresis", "flexspline::LoadHysteresis<S>", Stage::none,
                "compliance"},
      chain.hysteresis);
  use(StageInfo{"compliant_observer", "compliant_observer",
                "typename flexspline::MomentumObserver<S>::Config", Stage::compliant_observer},
      chain.compliant_observer);
  use(StageInfo{"kalman", "kalman", "typename flexspline::KalmanMerge<S>::Config", Stage::merge,
                "merge"},
      chain.kalman);
  use(StageInfo{"logistic", "logistic", "flexspline::LogisticMerge<S>", Stage::merge, "merge"},
      chain.logistic);
  choose(at_rests, chain.at_rest, runs(chain.kalman) || runs(chain.logistic));
  use(StageInfo{"collision", "collision",
                "typename flexspline::CollisionDetector<S, {negative}>::Config", Stage::collision},
      chain.collision);
  choose(watched_ones, chain.watched, runs(chain.collision));
  use(StageInfo{"adaptation", "adaptation", "typename flexspline::Adaptation<S, {low}>::Config"},
      chain.adaptation);
}

}  // namespace flexspline
