/// The stages of a chain: which there are, and which of them a joint has.
///
/// A chain reads its stages from the fields of any struct. A field that is a stage always runs; an
/// `std::optional` of one runs where it has a value (`AnyStages`: chosen at run time); one that is
/// `Absent` never does, and costs neither code nor time. An exported header derives from `NoStages`
/// and has its own stages as fields, which hide those that are absent.
#pragma once

#include <cstdint>
#include <optional>

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
};

}  // namespace flexspline
