/// One joint, from raw readings to the external torque: the models of its parts and the chain.
///
///   sensing      thermistor, compensation, calibration → temperature, sensor torque
///   models       what each part says of this sample
///   estimating   observer, compliance, merge, collision
///
/// Both are a `Chain`; the models come between them, for they read the temperature. The load that
/// an effect reads is the sensor's external torque. The sensor's own part is asked twice where it
/// reads the load: once with none, then with what that leaves, which leaves an error of the second
/// order in a gain. In a joint without sensor the load is the compliance's external torque of the
/// sample before, or of the last that had one, not held at the pole; 0 until there is one, and
/// where the chain has no compliance.
///
/// A reading that is missing stays NaN (an angle: empty); the stages that need it are in `missed`.
/// The models go on with the last good temperature. State{} has seen nothing: assign it after a
/// gap. Temperatures outside of [low, high], where the parts were fitted: `extrapolated`.
#pragma once

#include "flexspline/estimators/chain.hpp"
#include "flexspline/model.hpp"
#include "flexspline/torsion.hpp"

namespace flexspline {

/// What is read in one period. SI units, signs as in the log format.
template <typename S>
struct Reading {
  static constexpr S missing = std::numeric_limits<S>::quiet_NaN();

  S period = missing;                       ///< s since the last reading
  std::optional<Angle<S>> output_position;  ///< q
  std::optional<Angle<S>> motor_position;   ///< θ
  S output_velocity = missing;              ///< rad/s
  S output_acceleration = missing;          ///< rad/s²
  S motor_torque = missing;                 ///< Nm at the motor's shaft
  S sensor_voltage = missing;               ///< V
  S sensor_torque = missing;                ///< Nm, where no voltage is read
  S thermistor_voltage = missing;           ///< V
  S temperature = missing;                  ///< °C, where no thermistor is read
  S time = missing;                         ///< s since the run began
};

/// Models: `Sensor` of the sensor's part; `Observed` of the observer's torque, without inertia;
/// `Torsion` without the mesh and what the chain knows of hysteresis; `Carried` of what the gear
/// carries beside the load: gravity.
/// `Model<S>`, without effects, where there is none.
template <typename S, typename Sensor, typename Observed, typename Torsion, typename Carried>
struct Joint {
  using Chain = flexspline::Chain<S>;

  typename Chain::Config sensing;
  typename Chain::Config estimating;
  Sensor sensor;
  Observed observed;
  Torsion torsion;
  Carried carried;
  S effective_ratio = 1;                   ///< Ñ
  S inertia = 0;                           ///< kg m² at the output, of the observer
  S link_inertia = 0;                      ///< kg m² at the output, of the compliant observer
  S low = -std::numeric_limits<S>::max();  ///< °C, range of the parts' fits
  S high = std::numeric_limits<S>::max();

  struct State {
    typename Chain::State sensing, estimating;
    typename Chain::Output sensed;
    S temperature = Chain::missing;  ///< °C, the last good one
    S gear_load = 0;                 ///< Nm, the compliance's last external torque not held
    typename Sensor::State sensor, sensor_without_load;
    typename Observed::State observed;
    typename Torsion::State torsion;
    typename Carried::State carried;
  };

  /// One period. `out` keeps the last good value of a stage that missed.
  constexpr Status step(State& state, const Reading<S>& in,
                        typename Chain::Output& out) const noexcept {
    const Status sensed = Chain::step(sensing, state.sensing, sensing_input(in), state.sensed);
    if (sensed != Status::ok) return sensed;
    Sample<S> at = sample(in, state);
    const Status estimated =
        Chain::step(estimating, state.estimating, estimating_input(in, at, state), out);
    if (estimated != Status::ok) return estimated;
    if (estimating.compliance && !has(out.missed, Stage::compliance) &&
        !has(out.flags, Flag::saturated)) {
      state.gear_load = out.external_compliance;
    }
    out.temperature = state.sensed.temperature;
    if (sensing.sensor) out.sensor_torque = state.sensed.sensor_torque;
    out.missed = out.missed | state.sensed.missed;
    out.flags = out.flags | state.sensed.flags;
    if (at.temperature < low || at.temperature > high) out.flags = out.flags | Flag::extrapolated;
    return Status::ok;
  }

 private:
  static constexpr typename Chain::Input sensing_input(const Reading<S>& in) noexcept {
    typename Chain::Input input;
    input.period = in.period;
    input.voltage = in.sensor_voltage;
    input.thermistor_voltage = in.thermistor_voltage;
    input.temperature = in.temperature;
    input.sensor_torque = in.sensor_torque;
    return input;
  }

  constexpr Sample<S> sample(const Reading<S>& in, State& state) const noexcept {
    const bool warm = sensing.thermistor ? !has(state.sensed.missed, Stage::thermistor)
                                         : Chain::is_temperature(in.temperature);
    if (warm) state.temperature = state.sensed.temperature;
    Sample<S> at;
    at.output_position = in.output_position.value_or(Angle<S>{});
    at.motor_position = in.motor_position.value_or(Angle<S>{});
    at.output_velocity = in.output_velocity;
    at.output_acceleration = in.output_acceleration;
    at.temperature = state.temperature;
    at.motor_torque = in.motor_torque;
    at.period = in.period;
    at.time = in.time;
    return at;
  }

  constexpr typename Chain::Input estimating_input(const Reading<S>& in, Sample<S>& at,
                                                   State& state) const noexcept {
    typename Chain::Input input;
    input.period = in.period;
    input.velocity = in.output_velocity;
    input.motor_torque = effective_ratio * in.motor_torque;
    input.momentum = inertia == S(0) ? S(0) : inertia * in.output_velocity;
    input.link_momentum = link_inertia == S(0) ? S(0) : link_inertia * in.output_velocity;
    if (sensing.sensor) {
      const bool read = !has(state.sensed.missed, Stage::sensor);
      input.sensor_torque = read ? state.sensed.sensor_torque : Chain::missing;
      input.sensor_intrinsic = intrinsic(in, at, state, input.sensor_torque);
      at.known_load = input.sensor_torque - input.sensor_intrinsic;
    } else {
      at.known_load = state.gear_load;
    }
    input.observer_intrinsic = predicted(observed, in, at, state.observed);
    input.gear_known = predicted(carried, in, at, state.carried);
    if (estimating.compliance) input.torsion = mesh(in, at, state);
    return input;
  }

  /// What the sensor reads beside the load.
  constexpr S intrinsic(const Reading<S>& in, Sample<S> at, State& state, S torque) const noexcept {
    if constexpr (Sensor::uses(Channel::load)) {
      at.known_load = torque - predicted(sensor, in, at, state.sensor_without_load);
    }
    return predicted(sensor, in, at, state.sensor);
  }

  /// The torsion's model reads no load: the chain has what does.
  constexpr S mesh(const Reading<S>& in, Sample<S> at, State& state) const noexcept {
    at.known_load = S(0);
    const S rest = predicted(torsion, in, at, state.torsion);
    if (!in.output_position || !in.motor_position || !math::is_finite(rest)) return Chain::missing;
    return mesh_torsion_left(torsion.gear, effective_ratio, *in.output_position,
                             in.motor_position->phase, rest);
  }

  /// NaN where the model cannot say.
  template <typename Model>
  static constexpr S predicted(const Model& model, const Reading<S>& in, const Sample<S>& at,
                               typename Model::State& state) noexcept {
    constexpr bool turns = Model::uses(Channel::motor_position);
    constexpr bool angle = turns || Model::uses(Channel::output_position);
    if (angle && !in.output_position) return Chain::missing;
    if (turns && model.gear.motor_encoder && !in.motor_position) return Chain::missing;
    S torque = S(0);
    return model.predict(at, state, torque) == Status::ok ? torque : Chain::missing;
  }
};

}  // namespace flexspline
