/// What drives a fitted joint from outside, between two rows of its log.
#pragma once

#include <cstddef>

namespace flexspline::batch::forward {

/// Borrowed columns of equal length; null where nothing is given. The time increases strictly.
struct Signals {
  std::size_t size = 0;
  const double* time = nullptr;         ///< s
  const double* motor = nullptr;        ///< Nm at the shaft or A; what the motor gives
  const double* known_load = nullptr;   ///< Nm
  const double* temperature = nullptr;  ///< °C
  const double* command = nullptr;      ///< rad at the output, what a servo is told
  const double* enabled = nullptr;      ///< 0: the servo gives no torque
  const double* supply = nullptr;       ///< V, of the servo
  bool hold = false;  ///< the motor's column holds its value from row to row; else it is linear
};

/// A value that changes linearly in time.
struct Ramp {
  double value = 0;
  double slope = 0;

  /// `late`: s since the ramp's start.
  constexpr double at(double late) const noexcept { return value + slope * late; }
};

/// The inputs over a stretch without jumps, times counted from its start.
struct Inputs {
  Ramp motor;          ///< Nm at the shaft, or A
  Ramp known_load;     ///< Nm
  Ramp temperature;    ///< °C
  double time = 0;     ///< s since the run began, at the start of the stretch
  double damping = 0;  ///< what the motor gives less for each rad/s of the output (back-EMF)
};

/// From row i to the next one.
inline Ramp ramp(const double* column, std::size_t i, double period, double absent) noexcept {
  if (column == nullptr) return {absent, 0};
  return {column[i], (column[i + 1] - column[i]) / period};
}

inline Inputs inputs_from(const Signals& signals, std::size_t i) noexcept {
  const double period = signals.time[i + 1] - signals.time[i];
  Inputs in;
  in.motor = ramp(signals.motor, i, period, 0);
  if (signals.hold) in.motor.slope = 0;
  in.known_load = ramp(signals.known_load, i, period, 0);
  in.temperature = ramp(signals.temperature, i, period, 25);
  in.time = signals.time[i] - signals.time[0];
  return in;
}

}  // namespace flexspline::batch::forward
