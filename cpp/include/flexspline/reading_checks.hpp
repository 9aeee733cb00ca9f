/// Readings that cannot be true are taken out before the chain uses them.
///
///   range      a converter at its end, a torque, a speed or an acceleration that the joint cannot
///   have motion     q does not go where its velocity says:  e ← (1 − f T) e + Δq − T q̇,    |e| >
///   way encoders   q and θ do not turn together:           e ← (1 − f T) e + Ñ Δq − Δθ,   |e| >
///   twist
///
/// A stuck encoder adds to e the way that the joint goes, a
/// step adds itself, a swapped sign twice the way; f forgets what torsion, lateness and counting
/// leave there. A joint at rest hides a stuck encoder, and so does one slower than way · f or
/// twist · f. Which of the two readings is wrong is not known: position, velocity and acceleration
/// all count as missing while they disagree, so the stages that read them keep their last good
/// values and say so in `missed`. Behind a step the new angle is believed once e, which is held at
/// four times its limit, is forgotten: 1.4 / f later. A period above 1 / f compares nothing.
///
///   torques    external torques of sensor and observer are further apart than `apart`
///
/// is seen behind the chain and takes nothing out: a sensor or a motor current of the wrong sign.
///
/// Optional. What is missing already stays so, a bad period is left to the chain. Some forty
/// operations without a division.
#pragma once

#include "flexspline/joint.hpp"

namespace flexspline {

/// What was taken out of a reading, as bits.
enum class Fault : std::uint8_t {
  none = 0,
  sensor = 1,     ///< voltage or torque of the sensor out of range
  motor = 2,      ///< motor torque out of range
  speed = 4,      ///< velocity out of range
  motion = 8,     ///< angle and velocity disagree
  encoders = 16,  ///< both angles disagree
  torques = 32    ///< torques of sensor and observer disagree
};

constexpr Fault operator|(Fault a, Fault b) noexcept {
  return static_cast<Fault>(static_cast<std::uint8_t>(a) | static_cast<std::uint8_t>(b));
}
/// Whether `faults` has the bit of `wanted`.
constexpr bool has(Fault faults, Fault wanted) noexcept {
  return (static_cast<std::uint8_t>(faults) & static_cast<std::uint8_t>(wanted)) != 0;
}

template <typename S>
struct ReadingChecks {
  static constexpr S largest = std::numeric_limits<S>::max();

  struct Config {
    S least_voltage = -largest;  ///< V of the bridge, both just inside the converter's ends
    S most_voltage = largest;
    S most_sensor_torque = largest;  ///< Nm, either way
    S most_motor_torque = largest;   ///< Nm at the motor's shaft, either way
    S most_speed = largest;          ///< rad/s at the output, either way
    S most_acceleration = largest;   ///< rad/s² at the output, between two velocities
    S way = 0;                       ///< rad at the output, above what is late and noisy; 0: off
    S twist = 0;                     ///< rad at the motor, above torsion under full load; 0: off
    S forget = S(10);                ///< f, 1/s
    S apart = largest;               ///< Nm, above what the observer is late by
    Gear<S> gear;
  };
  struct State {
    Phase<S> output, ahead;  ///< q and Ñ q − θ of the last reading that had them
    S velocity = 0;          ///< rad/s, of the last reading
    S astray = 0;            ///< e, rad at the output
    S twisted = 0;           ///< e, rad at the motor
    bool has_output = false, has_ahead = false, has_velocity = false;
  };

  /// Takes out of `in` what cannot be true; says what.
  static constexpr Fault step(const Config& config, State& state, Reading<S>& in) noexcept {
    if (!(in.period > S(0))) return Fault::none;
    const S keep = math::clamp(S(1) - config.forget * in.period, S(0), S(1));
    Fault found = Fault::none;
    if (jumps(config, state, in)) found = found | Fault::speed;
    if (strays(config, state, in, keep)) found = found | Fault::motion;
    if (twists(config, state, in, keep)) found = found | Fault::encoders;
    if (found != Fault::none) {
      in.output_position = in.motor_position = std::nullopt;
      in.output_velocity = in.output_acceleration = Reading<S>::missing;
    }
    if (take_out(in.sensor_voltage, config.least_voltage, config.most_voltage)) {
      found = found | Fault::sensor;
    }
    if (take_out(in.sensor_torque, -config.most_sensor_torque, config.most_sensor_torque)) {
      found = found | Fault::sensor;
    }
    if (take_out(in.motor_torque, -config.most_motor_torque, config.most_motor_torque)) {
      found = found | Fault::motor;
    }
    if (take_out(in.output_velocity, -config.most_speed, config.most_speed)) {
      found = found | Fault::speed;
    }
    return found;
  }

  /// Whether two witnesses of the external torque are too far apart.
  static constexpr Fault torques(const Config& config,
                                 const typename Chain<S>::Output& out) noexcept {
    const bool both = !has(out.missed, Stage::sensor) && !has(out.missed, Stage::observer);
    const S between = math::absolute(out.external_sensor - out.external_observer);
    return both && between > config.apart ? Fault::torques : Fault::none;
  }

 private:
  static constexpr S radians = S(2) * math::pi<S>;

  static constexpr bool take_out(S& value, S low, S high) noexcept {
    const bool outside = value < low || value > high;  // NaN is in neither
    if (outside) value = Reading<S>::missing;
    return outside;
  }

  static constexpr bool jumps(const Config& config, State& state, const Reading<S>& in) noexcept {
    const S changed = math::absolute(in.output_velocity - state.velocity);
    const bool jumped = state.has_velocity && changed > config.most_acceleration * in.period;
    state.velocity = in.output_velocity;
    state.has_velocity = math::is_finite(in.output_velocity);
    return jumped;
  }

  static constexpr bool strays(const Config& config, State& state, const Reading<S>& in,
                               S keep) noexcept {
    if (config.way == S(0)) return false;
    const bool read = in.output_position && math::is_finite(in.output_velocity);
    const Phase<S> at = in.output_position.value_or(Angle<S>{}).phase;
    S moved = S(0);
    if (read && state.has_output) {
      moved = radians * (at - state.output).shortest() - in.output_velocity * in.period;
    }
    state.has_output = read;
    state.output = at;
    return gone(state.astray, keep, moved, config.way);
  }

  static constexpr bool twists(const Config& config, State& state, const Reading<S>& in,
                               S keep) noexcept {
    if (config.twist == S(0)) return false;
    const bool read = in.output_position && in.motor_position;
    const Phase<S> at = config.gear.motor_phase(in.output_position.value_or(Angle<S>{})) -
                        in.motor_position.value_or(Angle<S>{}).phase;
    const S moved = read && state.has_ahead ? radians * (at - state.ahead).shortest() : S(0);
    state.has_ahead = read;
    state.ahead = at;
    return gone(state.twisted, keep, moved, config.twist);
  }

  /// Whether the way that two readings disagree by is now too long.
  static constexpr bool gone(S& way, S keep, S moved, S most) noexcept {
    const S added = keep > S(0) ? moved : S(0);
    way = math::clamp(keep * way + added, S(-4) * most, S(4) * most);
    return math::absolute(way) > most;
  }
};

}  // namespace flexspline
