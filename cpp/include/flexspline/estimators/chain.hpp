/// From raw channels to the external torque and a contact: all estimators in one step.
///
///   thermistor     voltage → temperature
///   compensation   temperature → torque of the drift
///   sensor         voltage → sensor torque (or the channel that is one already), + drift;
///                  less its intrinsic part → external torque
///   observer       sensor or motor torque, momentum → external torque
///   compliance     torsion → torque through the gear; less what is known of it → external torque
///   compliant      an observer of the link alone: that torque, momentum of the link → external
///   observer       torque, without the friction of motor and gear
///   merge          observer and, at rest, one of the last two → external torque
///   collision      one of the external torques → contact
///
/// A stage runs where it is configured, always in this order. What a model predicts is an input:
/// Model on the joint, a design on a PC; the chain holds no effects. A stage whose input is not
/// finite, out of range, or missing because a stage before it missed, keeps its last good outputs
/// and sets its bit in `missed`; its next period is longer. The one exception: temperatures come
/// seldom, so the sensor goes on with the drift of the last one, once there was one. A bad period
/// changes nothing at all; one above an hour is bad: no step that was ever due took that long, and
/// sums of such periods would overflow.
///
/// Source: zhang_disturbance_elimination (6)–(11), (21), (22); full_range_torque_estimation
/// (7), (8), (14)–(20); the compliant gear inside the observer is its own next step.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "flexspline/estimators/calibration.hpp"
#include "flexspline/estimators/collision_detector.hpp"
#include "flexspline/estimators/compliance.hpp"
#include "flexspline/estimators/kalman_merge.hpp"
#include "flexspline/estimators/load_hysteresis.hpp"
#include "flexspline/estimators/momentum_observer.hpp"
#include "flexspline/estimators/temperature_compensation.hpp"
#include "flexspline/estimators/thermistor.hpp"

namespace flexspline {

/// A stage of the chain, as a bit.
enum class Stage : std::uint8_t {
  none = 0,
  thermistor = 1,
  compensation = 2,
  sensor = 4,
  observer = 8,
  compliance = 16,
  merge = 32,
  collision = 64,
  compliant_observer = 128,
};

constexpr Stage operator|(Stage a, Stage b) noexcept {
  return static_cast<Stage>(static_cast<std::uint8_t>(a) | static_cast<std::uint8_t>(b));
}
/// Whether `stages` has the bit of `wanted`.
constexpr bool has(Stage stages, Stage wanted) noexcept {
  return (static_cast<std::uint8_t>(stages) & static_cast<std::uint8_t>(wanted)) != 0;
}

/// Which torque drives the observer.
enum class ObserverInput : unsigned char { sensor_torque, motor_torque };

/// Which external torque the merge takes at rest.
enum class AtRest : unsigned char { compliance, compliant_observer };

/// Which external torque the collision detector watches.
enum class Watched : unsigned char { observer, sensor, merged, compliant_observer };

template <typename S, std::size_t Degree = 6, std::size_t Bands = 8>
struct Chain {
  using Compensation = TemperatureCompensation<S, Degree>;
  using Observer = MomentumObserver<S>;
  using Kalman = KalmanMerge<S>;
  using Detector = CollisionDetector<S, Bands>;

  static constexpr S missing = std::numeric_limits<S>::quiet_NaN();
  static constexpr S longest_period = S(3600);  ///< s

  /// Whether a temperature, °C, is one: what no instrument measures counts as not read, because a
  /// lag takes long to forget it. NaN is none.
  static constexpr bool is_temperature(S value) noexcept {
    return value >= S(-273.15L) && value <= S(10000);
  }

  /// A stage without a value does not run.
  struct Config {
    std::optional<Thermistor<S>> thermistor;  ///< without: the temperature is a channel
    std::optional<typename Compensation::Config> compensation;
    bool sensor = false;
    std::optional<Calibration<S>> calibration;  ///< without: the sensor torque is a channel
    std::optional<typename Observer::Config> observer;
    ObserverInput observer_input = ObserverInput::sensor_torque;
    std::optional<Compliance<S>> compliance;
    std::optional<LoadHysteresis<S>> hysteresis;  ///< of the compliance
    std::optional<typename Observer::Config> compliant_observer;
    std::optional<LogisticMerge<S>> logistic;
    std::optional<typename Kalman::Config> kalman;  ///< comes before `logistic`
    AtRest at_rest = AtRest::compliance;
    std::optional<typename Detector::Config> collision;
    Watched watched = Watched::observer;
  };

  /// One sample; a measured channel that is not there stays NaN.
  struct Input {
    S period = missing;              ///< s since the last sample
    S voltage = missing;             ///< V, of the bridge
    S thermistor_voltage = missing;  ///< V
    S temperature = missing;         ///< °C
    S sensor_torque = missing;       ///< Nm
    S sensor_intrinsic = 0;          ///< Nm, the model's sensor torque without the external one
    S motor_torque = missing;        ///< Nm at the output, Ñ τ_m
    S momentum = 0;                  ///< Nm s at the output, J q̇; 0 makes the observer a low pass
    S observer_intrinsic = 0;  ///< Nm, the model's part of the observer's torque without inertia
    S torsion = missing;       ///< Δθ_m, rad at the output: error and wave generator taken off
    S gear_known = 0;          ///< Nm, known part of the gear's torque: load, gravity, inertia
    S link_momentum = 0;       ///< Nm s at the output, J_l q̇, of what is behind the gear
    S velocity = missing;      ///< rad/s at the output
  };

  /// Last good values; all external torques in Nm, positive outward.
  struct Output {
    S temperature = 0;    ///< °C
    S sensor_torque = 0;  ///< Nm, compensated
    S external_sensor = 0;
    S external_observer = 0;
    S external_compliance = 0;
    S external_compliant_observer = 0;
    S external_merged = 0;
    S merge_weight = 0;  ///< share of the observer in the logistic merge
    bool contact = false;
    Flag flags = Flag::none;     ///< of the stages that ran in this sample
    Stage missed = Stage::none;  ///< configured stages that did not run in this sample
  };

  struct State {
    typename Compensation::State compensation;
    FlaggedTorque<S> drift;  ///< the compensation's last good torque
    typename Observer::State observer, compliant_observer;
    typename LoadHysteresis<S>::State hysteresis;
    typename Kalman::State kalman;
    typename Detector::State collision;
    /// Time since the last good sample of each stage whose memory counts time, s.
    S compensation_wait = 0, observer_wait = 0, compliant_wait = 0, kalman_wait = 0,
      collision_wait = 0;
  };

  static constexpr Status step(const Config& config, State& state, const Input& in,
                               Output& out) noexcept {
    if (!(in.period > S(0)) || !(in.period <= longest_period)) return Status::bad_period;
    out.flags = Flag::none;
    out.missed = Stage::none;
    const bool warm = read_temperature(config, in, out);
    const bool known_drift = compensate(config, state, in, warm, out);
    const bool sensor = read_sensor(config, state, in, known_drift, out);
    const bool observer = observe(config, state, in, sensor, out);
    const bool compliance = untwist(config, state, in, out);
    const bool link = observe_link(config, state, in, compliance, out);
    const bool still = config.at_rest == AtRest::compliance ? compliance : link;
    const bool merged = merge(config, state, in, observer && still, out);
    const bool fresh = config.watched == Watched::observer ? observer
                       : config.watched == Watched::sensor ? sensor
                       : config.watched == Watched::merged ? merged
                                                           : link;
    watch(config, state, in, fresh, out);
    return Status::ok;
  }

 private:
  /// Sets the bit of a stage that missed; whether it ran.
  static constexpr bool ran(bool good, Stage stage, Output& out) noexcept {
    if (!good) out.missed = out.missed | stage;
    return good;
  }

  static constexpr bool read_temperature(const Config& config, const Input& in,
                                         Output& out) noexcept {
    S temperature = in.temperature;
    const bool read = !config.thermistor || config.thermistor->temperature(
                                                in.thermistor_voltage, temperature) == Status::ok;
    const bool good = read && is_temperature(temperature);
    if (good) out.temperature = temperature;
    return config.thermistor ? ran(good, Stage::thermistor, out) : good;
  }

  /// Whether the drift is known, from this sample or an earlier one.
  static constexpr bool compensate(const Config& config, State& state, const Input& in, bool warm,
                                   Output& out) noexcept {
    if (!config.compensation) return true;
    state.compensation_wait += in.period;
    const bool good =
        warm && Compensation::step(*config.compensation, state.compensation, out.temperature,
                                   state.compensation_wait, state.drift) == Status::ok;
    if (ran(good, Stage::compensation, out)) state.compensation_wait = S(0);
    return state.compensation.started;
  }

  static constexpr bool read_sensor(const Config& config, const State& state, const Input& in,
                                    bool known_drift, Output& out) noexcept {
    if (!config.sensor) return false;
    FlaggedTorque<S> torque{in.sensor_torque + state.drift.torque, Flag::none};
    bool good = known_drift;
    if (config.calibration) {
      good =
          good && config.calibration->torque(in.voltage, state.drift.torque, torque) == Status::ok;
    }
    const S external = torque.torque - in.sensor_intrinsic;
    if (!ran(good && math::is_finite(external), Stage::sensor, out)) return false;
    out.sensor_torque = torque.torque;
    out.external_sensor = external;
    out.flags = out.flags | torque.flags | state.drift.flags;
    return true;
  }

  static constexpr bool observe(const Config& config, State& state, const Input& in, bool sensor,
                                Output& out) noexcept {
    if (!config.observer) return false;
    const bool by_sensor = config.observer_input == ObserverInput::sensor_torque;
    const S torque = by_sensor ? (sensor ? out.sensor_torque : missing) : in.motor_torque;
    state.observer_wait += in.period;
    const bool seen =
        observed(*config.observer, state.observer, in.momentum, torque - in.observer_intrinsic,
                 state.observer_wait, out.external_observer);
    return ran(seen, Stage::observer, out);
  }

  static constexpr bool observe_link(const Config& config, State& state, const Input& in,
                                     bool compliance, Output& out) noexcept {
    if (!config.compliant_observer) return false;
    state.compliant_wait += in.period;
    const bool seen = observed(*config.compliant_observer, state.compliant_observer,
                               in.link_momentum, compliance ? out.external_compliance : missing,
                               state.compliant_wait, out.external_compliant_observer);
    return ran(seen, Stage::compliant_observer, out);
  }

  /// `wait`: s since the last good sample, 0 behind one.
  static constexpr bool observed(const typename Observer::Config& config,
                                 typename Observer::State& state, S momentum, S known_torque,
                                 S& wait, S& external) noexcept {
    const Status seen = Observer::step(config, state, momentum, known_torque, wait, external);
    // After a gap too long for Euler: start again from where it was.
    if (seen == Status::out_of_range) state.started = false;
    if (seen == Status::ok || seen == Status::out_of_range) wait = S(0);
    return seen == Status::ok;
  }

  static constexpr bool untwist(const Config& config, State& state, const Input& in,
                                Output& out) noexcept {
    if (!config.compliance) return false;
    FlaggedTorque<S> gear;
    const bool read = math::is_finite(in.gear_known) && twisted(config, state, in, gear);
    const S external = gear.torque - in.gear_known;
    if (!ran(read && math::is_finite(external), Stage::compliance, out)) return false;
    out.external_compliance = external;
    out.flags = out.flags | gear.flags;
    return true;
  }

  static constexpr bool twisted(const Config& config, State& state, const Input& in,
                                FlaggedTorque<S>& gear) noexcept {
    if (!config.hysteresis) return config.compliance->torque(in.torsion, gear) == Status::ok;
    S left = S(0);
    return config.hysteresis->torque(*config.compliance, state.hysteresis, in.torsion, left,
                                     gear) == Status::ok;
  }

  static constexpr bool merge(const Config& config, State& state, const Input& in, bool fresh,
                              Output& out) noexcept {
    if (!config.kalman && !config.logistic) return false;
    if (config.kalman) state.kalman_wait += in.period;
    if (!ran(fresh, Stage::merge, out)) return false;
    const S still = config.at_rest == AtRest::compliance ? out.external_compliance
                                                         : out.external_compliant_observer;
    if (!config.kalman) {
      const Status merged = config.logistic->merge(in.velocity, out.external_observer, still,
                                                   out.merge_weight, out.external_merged);
      return ran(merged == Status::ok, Stage::merge, out);
    }
    const Status merged =
        Kalman::step(*config.kalman, state.kalman, in.velocity, out.external_observer, still,
                     state.kalman_wait, out.external_merged);
    if (merged == Status::ok) state.kalman_wait = S(0);
    return ran(merged == Status::ok, Stage::merge, out);
  }

  static constexpr void watch(const Config& config, State& state, const Input& in, bool fresh,
                              Output& out) noexcept {
    if (!config.collision) return;
    state.collision_wait += in.period;
    const S residual = config.watched == Watched::observer ? out.external_observer
                       : config.watched == Watched::sensor ? out.external_sensor
                       : config.watched == Watched::merged ? out.external_merged
                                                           : out.external_compliant_observer;
    const bool good =
        fresh && Detector::step(*config.collision, state.collision, residual, in.velocity,
                                state.collision_wait, out.contact) == Status::ok;
    if (ran(good, Stage::collision, out)) state.collision_wait = S(0);
  }
};

}  // namespace flexspline
