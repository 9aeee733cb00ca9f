/// What a device reads in one period.
#pragma once

#include <limits>
#include <optional>

#include "flexspline/angle.hpp"

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

}  // namespace flexspline
