// Rows of samples, eleven doubles each, as device.py writes them.
//
// Output angle (two numbers), motor angle (two numbers), velocity, acceleration, temperature, known
// load, motor torque, period (0 at a start), time. What an angle's numbers are, each program says.
#pragma once

#include <array>

#include "flexspline/sample.hpp"

/// What of a row is no angle.
template <typename S>
void read_numbers(const std::array<double, 11>& row, flexspline::Sample<S>& at) noexcept {
  at.output_velocity = static_cast<S>(row[4]);
  at.output_acceleration = static_cast<S>(row[5]);
  at.temperature = static_cast<S>(row[6]);
  at.known_load = static_cast<S>(row[7]);
  at.motor_torque = static_cast<S>(row[8]);
  at.period = static_cast<S>(row[9]);
  at.time = static_cast<S>(row[10]);
}
