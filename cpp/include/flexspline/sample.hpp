/// The channels of one instant: as a device reads them, and as models see them.
///
/// A channel that is a plain number is a member of `Sample` and of `Reading`, a `Channel` with its
/// name, and a row of `numbers`, with its limit in `reading_limits.hpp`; chain, models, replays and
/// programs of certificates follow.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

#include "flexspline/angle.hpp"

namespace flexspline {

/// What an effect reads of a sample.
enum class Channel : unsigned char {
  output_position,
  output_velocity,
  output_acceleration,
  motor_position,
  temperature,
  load,  ///< the transmitted torque, filled by the model
  motor_torque,
  period,  ///< time since the sample before
  time,    ///< since the run began
};
inline constexpr std::array<std::string_view, 9> channel_names{
    "output_position", "output_velocity", "output_acceleration",
    "motor_position",  "temperature",     "load",
    "motor_torque",    "period",          "time"};

/// What is known of a joint at one instant. SI units; signs as in the log format: torques are
/// positive when the joint pushes outward, the motor side is counted so that θ ≈ +Ñ q.
template <typename S>
struct Sample {
  Angle<S> output_position;   ///< q, link side
  S output_velocity = 0;      ///< rad/s
  S output_acceleration = 0;  ///< rad/s²
  Angle<S> motor_position;    ///< θ; filled from q where the joint has no motor encoder
  S temperature = 25;         ///< °C
  S known_load = 0;           ///< Nm at the output, τ_load measured by something trusted
  S motor_torque = 0;         ///< Nm at the motor's shaft, τ_m
  S period = 0;               ///< s since the last sample that was taken
  S time = 0;                 ///< s since the run began

  // Filled by Model::prepare.
  Phase<S> wave_generator_on_flexspline;
  Phase<S> wave_generator_on_circular_spline;
  S load = 0;  ///< Nm, torque that the gear transmits: known load, inertia and gravity
};

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

template <typename S>
inline constexpr S longest_period = S(3600);  ///< s

/// Above zero and not above the longest; by their bits, as positive numbers compare.
template <typename S>
constexpr bool is_period(S value) noexcept {
  using Bits = math::Bits<S>;
  return std::bit_cast<Bits>(value) - 1 < std::bit_cast<Bits>(longest_period<S>);
}

/// A channel of models that is a plain number, in a reading and in a sample.
template <typename S>
struct Number {
  Channel channel;
  S Reading<S>::* read;
  S Sample<S>::* at;

  constexpr std::string_view name() const noexcept { return channel_names[std::size_t(channel)]; }
};
template <typename S>
inline constexpr std::array<Number<S>, 6> numbers{{
    {Channel::output_velocity, &Reading<S>::output_velocity, &Sample<S>::output_velocity},
    {Channel::output_acceleration, &Reading<S>::output_acceleration,
     &Sample<S>::output_acceleration},
    {Channel::temperature, &Reading<S>::temperature, &Sample<S>::temperature},
    {Channel::motor_torque, &Reading<S>::motor_torque, &Sample<S>::motor_torque},
    {Channel::period, &Reading<S>::period, &Sample<S>::period},
    {Channel::time, &Reading<S>::time, &Sample<S>::time},
}};

/// A number that stages read and models do not.
template <typename S>
struct Instrument {
  std::string_view name;
  S Reading<S>::* read;
};
template <typename S>
inline constexpr std::array<Instrument<S>, 3> instruments{{
    {"thermistor_voltage", &Reading<S>::thermistor_voltage},
    {"sensor_voltage", &Reading<S>::sensor_voltage},
    {"sensor_torque", &Reading<S>::sensor_torque},
}};

/// The places in `numbers`, for what is written out.
using NumberPlaces = std::make_index_sequence<numbers<float>.size()>;

}  // namespace flexspline
