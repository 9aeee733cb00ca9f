/// How large a reading may be: beyond its limit, either way, it counts as missing.
///
/// One absurd sample would else be remembered: a load of 1e10 Nm drives every spring of a hysteresis
/// to its end, where it stays until the true load has gone through the whole loop; an observer, a
/// lag or a filter takes many time constants to come back from it. Limits are no judgement of what
/// the joint may do: they lie so far out that a crash is still read (reading_checks.hpp holds your
/// joint's own limits). What they keep out is no physical quantity any more: a bit that flipped on
/// the bus, a driver's mark for "no value", a converter that starts.
///
///   velocity, acceleration, torques, bridge   exported with the model: a multiple of the largest
///                                             in the logs of the fit, not above the values below
///                                             (python/flexspline/estimation/plan.py: which
///                                             multiple, and why); the values below where the
///                                             model does not know the largest
///   temperature, thermistor, time             the values below, for what was seen of them in a log
///                                             says little of what a device will see
///   angles                                    2^30 turns, beyond which they saturate, and no less:
///                                             a joint may turn on for ever, and turns and a
///                                             fraction are as exact there as in the first turn
///
/// NaN is beyond no limit: it is missing already. A limit at the largest number is none, and costs
/// nothing where it is a constant: an exported header has that for what its joint does not read.
#pragma once

#include "flexspline/fields.hpp"
#include "flexspline/sample.hpp"

namespace flexspline {

template <typename S>
struct ReadingLimits {
  static constexpr S none = std::numeric_limits<S>::max();

  S output_velocity = S(10'000);          ///< rad/s, of no shaft behind a gear
  S output_acceleration = S(10'000'000);  ///< rad/s², from standstill to that velocity within 1 ms
  S motor_torque = S(1'000'000);          ///< Nm at the motor's shaft, as below
  S sensor_voltage = S(1'000);            ///< V, at no converter's input
  S sensor_torque = S(1'000'000);   ///< Nm, 50 times the peak of the largest strain wave gears
  S thermistor_voltage = S(1'000);  ///< V
  S temperature = S(1'000);         ///< °C, above all that a sensor in a joint survives
  S time = S(1'000'000'000);        ///< s, thirty years

  static constexpr auto fields() noexcept {
    return std::tuple{
        Field{"output_velocity", "rad/s", &ReadingLimits::output_velocity, positive<S>},
        Field{"output_acceleration", "rad/s^2", &ReadingLimits::output_acceleration, positive<S>},
        Field{"motor_torque", "Nm at the motor's shaft", &ReadingLimits::motor_torque, positive<S>},
        Field{"sensor_voltage", "V", &ReadingLimits::sensor_voltage, positive<S>},
        Field{"sensor_torque", "Nm", &ReadingLimits::sensor_torque, positive<S>},
        Field{"thermistor_voltage", "V", &ReadingLimits::thermistor_voltage, positive<S>},
        Field{"temperature", "deg C", &ReadingLimits::temperature, positive<S>},
        Field{"time", "s", &ReadingLimits::time, positive<S>}};
  }

  /// Of a channel of models that is a number; of the load, the sensor's torque.
  constexpr S of(Channel channel) const noexcept {
    switch (channel) {
      case Channel::output_velocity:
        return output_velocity;
      case Channel::output_acceleration:
        return output_acceleration;
      case Channel::temperature:
        return temperature;
      case Channel::load:
        return sensor_torque;
      case Channel::motor_torque:
        return motor_torque;
      case Channel::time:
        return time;
      default:
        return none;
    }
  }

  /// Takes out of `in` what is beyond its limit; says of what kind, `beyond` that there was any.
  constexpr Fault take_out(Reading<S>& in, bool& beyond) const noexcept {
    const auto take = [&beyond](S& value, S most, Fault kind) {
      if (!(most < none && math::absolute(value) > most)) [[likely]]
        return Fault::none;
      value = Reading<S>::missing;
      beyond = true;
      return kind;
    };
    return take(in.output_velocity, output_velocity, Fault::speed) |
           take(in.output_acceleration, output_acceleration, Fault::speed) |
           take(in.motor_torque, motor_torque, Fault::motor) |
           take(in.sensor_voltage, sensor_voltage, Fault::sensor) |
           take(in.sensor_torque, sensor_torque, Fault::sensor) |
           take(in.thermistor_voltage, thermistor_voltage, Fault::temperature) |
           take(in.temperature, temperature, Fault::temperature) |
           take(in.time, time, Fault::none) | turned(in.output_position, beyond) |
           turned(in.motor_position, beyond);
  }

 private:
  static constexpr Fault turned(std::optional<Angle<S>>& angle, bool& beyond) noexcept {
    if (!angle || angle->in_range()) [[likely]]
      return Fault::none;
    angle = std::nullopt;
    beyond = true;
    return Fault::speed;
  }
};

/// Every number that models read has a limit, but for the period, which is checked by itself.
static_assert([] {
  for (const Number<float>& each : numbers<float>) {
    const bool limited = ReadingLimits<float>{}.of(each.channel) < ReadingLimits<float>::none;
    if (each.channel != Channel::period && !limited) return false;
  }
  return true;
}());

}  // namespace flexspline
