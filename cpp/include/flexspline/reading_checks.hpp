/// Readings that cannot be true are taken out before the chain uses them.
///
///   range     a converter at its end, a temperature, a torque, a speed or an acceleration that the
///             joint cannot have; |Δq| > speed · T: an angle that goes faster, out for that sample
///   motion    q does not go where its velocity says:  e ← (1 − f T) e + Δq − T q̇,    |e| > way
///   encoders  q and θ do not turn together:           e ← (1 − f T) e + Ñ Δq − Δθ,   |e| > twist
///
/// A stuck encoder adds to e the way that the joint goes, a step adds itself, a swapped sign twice
/// the way; f forgets what torsion, lateness and counting leave there. A joint at rest hides a
/// stuck encoder, and so does one slower than way · f or twist · f. Which of the two readings is
/// wrong is not known: position, velocity and acceleration all count as missing while they
/// disagree, so the stages that read them keep their last good values and say so in `missed`.
/// Behind a step the new angle is believed once e, which is held at four times its limit, is
/// forgotten: 1.4 / f later. A period above 1 / f, or an angle behind a missing one, is compared
/// with nothing.
///
///   torques    external torques of sensor and observer are further apart than `apart`
///
/// is seen behind the chain and takes nothing out: a sensor or a motor current of the wrong sign.
///
/// The first stage of a chain, where it is given. What is missing already stays so, a bad period is
/// left to the chain. No division; a limit that is not given costs nothing where it is a constant.
#pragma once

#include "flexspline/fields.hpp"
#include "flexspline/gear.hpp"
#include "flexspline/sample.hpp"

namespace flexspline {

template <typename S>
struct ReadingChecks {
  static constexpr S largest = std::numeric_limits<S>::max();

  struct Config {
    using Estimator = ReadingChecks;

    S least_voltage = -largest;  ///< V of the bridge, both just inside the converter's ends
    S most_voltage = largest;
    S least_thermistor_voltage = -largest;  ///< V, just above a short and just below an open line
    S most_thermistor_voltage = largest;
    S least_temperature = -largest;  ///< °C, of a temperature that is a channel
    S most_temperature = largest;
    S most_sensor_torque = largest;  ///< Nm, either way
    S most_motor_torque = largest;   ///< Nm at the motor's shaft, either way
    S most_speed = largest;          ///< rad/s at the output, either way
    S most_acceleration = largest;   ///< rad/s² at the output, between two velocities
    S way = 0;                       ///< rad at the output, above what is late and noisy; 0: off
    S twist = 0;                     ///< rad at the motor, above torsion under full load; 0: off
    S forget = S(10);                ///< f, 1/s, > 0
    S apart = largest;               ///< Nm, above what the observer is late by
    Gear<S> gear{};                  ///< of the twist

    static constexpr auto fields() noexcept {
      return std::tuple{
          Field{"least_voltage", "V of the bridge", &Config::least_voltage, finite<S>,
                "voltage_range", false},
          Field{"most_voltage", "V of the bridge", &Config::most_voltage, finite<S>,
                "voltage_range", false},
          Field{"least_thermistor_voltage", "V", &Config::least_thermistor_voltage, finite<S>,
                "thermistor_voltage_range", false},
          Field{"most_thermistor_voltage", "V", &Config::most_thermistor_voltage, finite<S>,
                "thermistor_voltage_range", false},
          Field{"least_temperature", "deg C", &Config::least_temperature, finite<S>,
                "temperature_range", false},
          Field{"most_temperature", "deg C", &Config::most_temperature, finite<S>,
                "temperature_range", false},
          Field{"most_sensor_torque", "Nm", &Config::most_sensor_torque, positive<S>, "", false},
          Field{"most_motor_torque", "Nm at the motor's shaft", &Config::most_motor_torque,
                positive<S>, "", false},
          Field{"most_speed", "rad/s", &Config::most_speed, positive<S>, "", false},
          Field{"most_acceleration", "rad/s^2", &Config::most_acceleration, positive<S>, "", false},
          Field{"way", "rad at the output", &Config::way, not_negative<S>, "", false},
          Field{"twist", "rad at the motor", &Config::twist, not_negative<S>, "", false},
          Field{"forget", "1/s", &Config::forget, positive<S>, "", false},
          Field{"apart", "Nm", &Config::apart, positive<S>, "", false}};
    }
  };
  struct State {
    Phase<S> output, ahead;            ///< q and Ñ q − θ of the last reading that had them
    S velocity = Reading<S>::missing;  ///< rad/s, of the last reading
    S astray = 0;                      ///< e, rad at the output
    S twisted = 0;                     ///< e, rad at the motor
    bool has_output = false, has_ahead = false;
  };

  /// Takes out of `in` what cannot be true; says what.
  static constexpr Fault step(const Config& config, State& state, Reading<S>& in) noexcept {
    return in.period > S(0) ? advance(config, state, in) : Fault::none;
  }

  /// The same for a period that is known to be good.
  static constexpr Fault advance(const Config& config, State& state, Reading<S>& in) noexcept {
    const Fault found = motion(config, state, in);
    if (found != Fault::none) [[unlikely]] {
      in.output_position = in.motor_position = std::nullopt;
      in.output_velocity = in.output_acceleration = Reading<S>::missing;
    }
    return found | ranges(config, in);
  }

  /// Whether two witnesses of the external torque, of a chain's outputs, are too far apart.
  template <typename Output>
  static constexpr Fault torques(const Config& config, const Output& out) noexcept {
    using Stage = decltype(out.missed);
    const S between = math::absolute(out.external_sensor - out.external_observer);
    if (!(config.apart < largest && between > config.apart)) [[likely]]
      return Fault::none;
    const bool both = !has(out.missed, Stage::sensor) && !has(out.missed, Stage::observer);
    return both ? Fault::torques : Fault::none;
  }

 private:
  static constexpr S radians = S(2) * math::pi<S>;

  static constexpr Fault motion(const Config& config, State& state, const Reading<S>& in) noexcept {
    S keep = S(1) - config.forget * in.period;
    if (!(keep > S(0))) [[unlikely]] {
      state = {};
      keep = S(0);
    }
    const bool read = in.output_position.has_value();
    const Phase<S> at = read ? in.output_position->phase : Phase<S>{};
    const S moved = read && state.has_output ? (at - state.output).shortest(radians) : S(0);
    const bool fast = jumps(config, state, in, moved);
    const bool stray = strays(config, state, in, read && state.has_output, moved, keep);
    const bool apart = twists(config, state, in, keep);
    state.output = at;
    state.has_output = read;
    return (fast ? Fault::speed : Fault::none) | (stray ? Fault::motion : Fault::none) |
           (apart ? Fault::encoders : Fault::none);
  }

  static constexpr Fault ranges(const Config& config, Reading<S>& in) noexcept {
    return take_out(in.sensor_voltage, config.least_voltage, config.most_voltage, Fault::sensor) |
           take_out(in.sensor_torque, config.most_sensor_torque, Fault::sensor) |
           take_out(in.thermistor_voltage, config.least_thermistor_voltage,
                    config.most_thermistor_voltage, Fault::temperature) |
           take_out(in.temperature, config.least_temperature, config.most_temperature,
                    Fault::temperature) |
           take_out(in.motor_torque, config.most_motor_torque, Fault::motor) |
           take_out(in.output_velocity, config.most_speed, Fault::speed);
  }

  static constexpr Fault take_out(S& value, S most, Fault found) noexcept {
    if (!(most < largest && math::absolute(value) > most)) [[likely]]
      return Fault::none;
    value = Reading<S>::missing;
    return found;
  }

  /// NaN is in no range and outside of none.
  static constexpr Fault take_out(S& value, S low, S high, Fault found) noexcept {
    const bool outside = (low > -largest && value < low) || (high < largest && value > high);
    if (!outside) [[likely]]
      return Fault::none;
    value = Reading<S>::missing;
    return found;
  }

  static constexpr bool jumps(const Config& config, State& state, const Reading<S>& in,
                              S moved) noexcept {
    const S changed = math::absolute(in.output_velocity - state.velocity);  // NaN is no jump
    state.velocity = in.output_velocity;
    return (config.most_acceleration < largest && changed > config.most_acceleration * in.period) ||
           (config.most_speed < largest && math::absolute(moved) > config.most_speed * in.period);
  }

  static constexpr bool strays(const Config& config, State& state, const Reading<S>& in, bool moves,
                               S moved, S keep) noexcept {
    if (config.way == S(0)) return false;
    const S astray = moves ? moved - in.output_velocity * in.period : S(0);
    return gone(state.astray, keep, astray, config.way);
  }

  static constexpr bool twists(const Config& config, State& state, const Reading<S>& in,
                               S keep) noexcept {
    if (config.twist == S(0)) return false;
    const bool read = in.output_position && in.motor_position;
    const Phase<S> at = config.gear.motor_phase(in.output_position.value_or(Angle<S>{})) -
                        in.motor_position.value_or(Angle<S>{}).phase;
    const S moved = read && state.has_ahead ? (at - state.ahead).shortest(radians) : S(0);
    state.has_ahead = read;
    state.ahead = at;
    return gone(state.twisted, keep, moved, config.twist);
  }

  /// Whether the way that two readings disagree by is now too long. What is not finite adds none.
  static constexpr bool gone(S& way, S keep, S moved, S most) noexcept {
    const S found = keep * way + moved;
    if (math::absolute(found) <= most) [[likely]] {
      way = found;
      return false;
    }
    way = math::clamp(math::is_finite(found) ? found : keep * way, S(4) * most);
    return math::absolute(way) > most;
  }
};

}  // namespace flexspline
