/// From raw channels to the external torque and a contact: all estimators in one step.
///
///   checks, differentiator: readings as the others take them (preprocessing.hpp)
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
/// A stage runs where it is given (stages.hpp), always in this order. What a model predicts is an
/// input, or asked for between the stages (`run`): the chain holds no effects. A stage whose input is
/// not finite, out of range, or missing because a stage before it missed, keeps its last good
/// outputs and sets its bit in `missed`; its next period is longer. The one exception: temperatures
/// come seldom, so the sensor goes on with the drift of the last one, once there was one. A bad
/// period changes nothing at all; one above an hour is bad: no step that was ever due took that
/// long, and sums of such periods would overflow.
///
/// Between stages NaN says that there is no value: it runs through all that is computed from it, so
/// each stage looks at its result alone, once.
///
/// Source: zhang_disturbance_elimination (6)–(11), (21), (22); full_range_torque_estimation
/// (7), (8), (14)–(20); the compliant gear inside the observer is its own next step.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "flexspline/estimators/stages.hpp"

namespace flexspline {

template <typename S>
struct Chain {
  using Compensation = TemperatureCompensation<S>;
  using Observer = MomentumObserver<S>;
  using Kalman = KalmanMerge<S>;
  using Detector = CollisionDetector<S>;
  using Config = AnyStages<S>;

  static constexpr S missing = std::numeric_limits<S>::quiet_NaN();
  static constexpr S longest_period = flexspline::longest_period<S>;
  /// Whether a temperature, °C, is one: what no instrument measures counts as not read, because a
  /// lag takes long to forget it. NaN is none.
  static constexpr bool is_temperature(S value) noexcept {
    using Bits = math::Bits<S>;
    const S kelvin = value + Thermistor<S>::zero_celsius;
    return std::bit_cast<Bits>(kelvin) <= std::bit_cast<Bits>(S(10273.15L));
  }

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
    Fault faults = Fault::none;  ///< what limits and checks found in this sample
    Stage missed = Stage::none;  ///< configured stages that did not run in this sample
  };

  struct State {
    typename Compensation::State compensation;
    FlaggedTorque<S> drift{missing, Flag::none};  ///< the compensation's last good torque
    typename Observer::State observer, compliant_observer;
    typename LoadHysteresis<S>::State hysteresis;
    typename Kalman::State kalman;
    typename Detector::State collision;
    /// Time between the last good sample and the one before this, of each stage whose memory counts
    /// time, s: 0 behind a good one.
    S compensation_wait = 0, observer_wait = 0, compliant_wait = 0, kalman_wait = 0,
      collision_wait = 0;
  };

  /// What was sensed in a sample, NaN where there was nothing.
  struct Sensed {
    S temperature = missing;  ///< °C
    S torque = missing;       ///< Nm, compensated
  };

  /// One sample whose models' predictions are inputs.
  template <typename Stages>
  static constexpr Status step(const Stages& stages, State& state, Input in, Output& out) noexcept {
    if (!is_period(in.period)) return Status::bad_period;
    out.flags = Flag::none;
    out.faults = Fault::none;
    out.missed = Stage::none;
    in.velocity = math::finite_or_nan(in.velocity);
    in.torsion = math::finite_or_nan(in.torsion);
    run(stages, stages, state, in, out, Given{});
    return Status::ok;
  }

  /// One sample through all stages: those of `sensing` up to the sensor's torque, those of
  /// `estimating` behind it. The models are told the temperature, measured(temperature), asked
  /// beside_load(torque, in) for what the sensor reads beside the load, and predict(external, in)
  /// fills in `in` what the stages behind read.
  template <typename Sensing, typename Estimating, typename Models>
  static constexpr Sensed run(const Sensing& sensing, const Estimating& estimating, State& state,
                              Input& in, Output& out, Models&& models) noexcept {
    const S temperature = measure(sensing, in, out);
    models.measured(temperature);
    compensate(sensing, state, in.period, temperature, out);
    const auto read = sense(sensing, state, in);
    const S intrinsic = models.beside_load(read.torque, in);
    const S external = subtract(sensing, read, intrinsic, out);
    models.predict(external, in);
    const S torque = math::is_finite(external) ? read.torque : missing;
    estimate(estimating, state, in, torque, external, out);
    return {temperature, read.torque};
  }

 private:
  /// Models that have said all beforehand.
  struct Given {
    static constexpr void measured(S) noexcept {}
    static constexpr S beside_load(S, const Input& in) noexcept { return in.sensor_intrinsic; }
    static constexpr void predict(S, Input&) noexcept {}
  };

  /// The temperature, NaN where there is none.
  template <typename Stages>
  static constexpr S measure(const Stages& stages, const Input& in, Output& out) noexcept {
    S found = in.temperature;
    const auto* thermistor = given(stages.thermistor);
    if (thermistor) {
      found = missing;
      (void)thermistor->temperature(in.thermistor_voltage, found);
    }
    if (!is_temperature(found)) return thermistor ? miss(Stage::thermistor, out) : missing;
    out.temperature = found;
    return found;
  }

  /// The drift of a temperature, kept for samples that have none.
  template <typename Stages>
  static constexpr void compensate(const Stages& stages, State& state, S period, S temperature,
                                   Output& out) noexcept {
    if (const auto* compensation = given(stages.compensation)) {
      using Estimator = typename std::remove_cvref_t<decltype(*compensation)>::Estimator;
      const S wait = state.compensation_wait + period;
      const bool good = Estimator::advance(*compensation, state.compensation, temperature, wait,
                                           state.drift) == Status::ok;
      if (!good) (void)miss(Stage::compensation, out);
      if (compensation->thermal_lag > S(0)) state.compensation_wait = good ? S(0) : wait;
    }
  }

  /// The sensor's torque, NaN where there is none.
  template <typename Stages>
  static constexpr FlaggedTorque<S> sense(const Stages& stages, const State& state,
                                          const Input& in) noexcept {
    FlaggedTorque<S> read{in.sensor_torque, Flag::none};
    const bool drifts = given(stages.compensation) != nullptr;
    const S drift = drifts ? state.drift.torque : S(0);
    if (const auto* calibration = given(stages.calibration)) {
      read = calibration->reading(in.voltage, drift);
    } else if (drifts) {
      read.torque += drift;
    }
    if (drifts) read.flags = read.flags | state.drift.flags;
    return read;
  }

  /// External torque of the sensor, NaN where it missed; its torque is kept where there is one.
  template <typename Stages>
  static constexpr S subtract(const Stages& stages, const FlaggedTorque<S>& read, S intrinsic,
                              Output& out) noexcept {
    if (!stages.sensor) return missing;
    const S external = read.torque - intrinsic;
    const bool good = math::is_finite(external);
    if (good || math::is_finite(read.torque)) {
      out.sensor_torque = read.torque;
      out.flags = out.flags | read.flags;
    }
    if (!good) return miss(Stage::sensor, out);
    out.external_sensor = external;
    return external;
  }

  /// All that comes after the sensor; its torque and external torque are NaN where it missed.
  template <typename Stages>
  static constexpr void estimate(const Stages& stages, State& state, const Input& in, S torque,
                                 S sensor, Output& out) noexcept {
    const S observer = observe(stages, state, in, torque, out);
    const S compliance = untwist(stages, state, in, out);
    const S link = observe_link(stages, state, in, compliance, out);
    const S still = stages.at_rest == AtRest::compliance ? compliance : link;
    const S merged = merge(stages, state, in, observer, still, out);
    const S watched = stages.watched == Watched::observer ? observer
                      : stages.watched == Watched::sensor ? sensor
                      : stages.watched == Watched::merged ? merged
                                                          : link;
    watch(stages, state, in, watched, out);
  }

  /// Sets the bit of a stage that missed.
  static constexpr S miss(Stage stage, Output& out) noexcept {
    out.missed = out.missed | stage;
    return missing;
  }

  template <typename Stages>
  static constexpr S observe(const Stages& stages, State& state, const Input& in, S sensor_torque,
                             Output& out) noexcept {
    if (const auto* observer = given(stages.observer)) {
      const bool by_sensor = stages.observer_input == ObserverInput::sensor_torque;
      const S known = (by_sensor ? sensor_torque : in.motor_torque) - in.observer_intrinsic;
      const S found =
          observed(*observer, state.observer, in.momentum, known, in.period, state.observer_wait);
      if (!math::is_finite(found)) return miss(Stage::observer, out);
      return out.external_observer = found;
    }
    return missing;
  }

  template <typename Stages>
  static constexpr S observe_link(const Stages& stages, State& state, const Input& in, S compliance,
                                  Output& out) noexcept {
    if (const auto* observer = given(stages.compliant_observer)) {
      const S found = observed(*observer, state.compliant_observer, in.link_momentum, compliance,
                               in.period, state.compliant_wait);
      if (!math::is_finite(found)) return miss(Stage::compliant_observer, out);
      return out.external_compliant_observer = found;
    }
    return missing;
  }

  /// `wait`: s between the last good sample and the one before this.
  static constexpr S observed(const typename Observer::Config& config,
                              typename Observer::State& state, S momentum, S known_torque, S period,
                              S& wait) noexcept {
    S external = missing;
    const S since = wait + period;
    const Status seen = Observer::advance(config, state, momentum, known_torque, since, external);
    // After a gap too long for Euler: start again from where it was.
    if (seen == Status::out_of_range) state.started = false;
    wait = seen == Status::not_finite ? since : S(0);
    return external;
  }

  template <typename Stages>
  static constexpr S untwist(const Stages& stages, State& state, const Input& in,
                             Output& out) noexcept {
    if (const auto* compliance = given(stages.compliance)) {
      FlaggedTorque<S> gear{missing, Flag::none};
      if (const auto* hysteresis = given(stages.hysteresis)) {
        S left = S(0);
        if (math::is_finite(in.gear_known)) {
          (void)hysteresis->torque(*compliance, state.hysteresis, in.torsion, left, gear);
        }
      } else {
        gear = compliance->twisted(in.torsion);
      }
      const S external = gear.torque - in.gear_known;
      if (!math::is_finite(external)) return miss(Stage::compliance, out);
      out.flags = out.flags | gear.flags;
      return out.external_compliance = external;
    }
    return missing;
  }

  template <typename Stages>
  static constexpr S merge(const Stages& stages, State& state, const Input& in, S moving, S still,
                           Output& out) noexcept {
    S found = missing;
    if (const auto* kalman = given(stages.kalman)) {
      const S since = state.kalman_wait + in.period;
      const Status merged =
          Kalman::advance(*kalman, state.kalman, in.velocity, moving, still, since, found);
      state.kalman_wait = merged == Status::ok ? S(0) : since;
    } else if (const auto* logistic = given(stages.logistic)) {
      (void)logistic->advance(in.velocity, moving, still, out.merge_weight, found);
    } else {
      return missing;
    }
    if (!math::is_finite(found)) return miss(Stage::merge, out);
    return out.external_merged = found;
  }

  template <typename Stages>
  static constexpr void watch(const Stages& stages, State& state, const Input& in, S residual,
                              Output& out) noexcept {
    if (const auto* collision = given(stages.collision)) {
      using Estimator = typename std::remove_cvref_t<decltype(*collision)>::Estimator;
      const S since = state.collision_wait + in.period;
      const bool good = Estimator::advance(*collision, state.collision, residual, in.velocity,
                                           since, out.contact) == Status::ok;
      if (!good) (void)miss(Stage::collision, out);
      state.collision_wait = good ? S(0) : since;
    }
  }
};

}  // namespace flexspline
