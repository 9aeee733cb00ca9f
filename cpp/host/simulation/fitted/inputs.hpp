/// What drives a fitted joint from outside, between two rows of its log.
#pragma once

#include "flexspline/each_place.hpp"
#include "flexspline/sample.hpp"
#include "host/simulation/common/ramp.hpp"

namespace flexspline::batch::forward {

/// Whether the motion, the motor or the clock makes a number of a sample; all others, such as the
/// temperature, are given.
constexpr bool is_made(Channel channel) noexcept {
  switch (channel) {
    case Channel::output_velocity:
    case Channel::output_acceleration:
    case Channel::motor_torque:
    case Channel::period:
    case Channel::time:
      return true;
    default:
      return false;
  }
}

/// Borrowed columns of equal length; null where nothing is given. The time increases strictly.
struct Signals {
  std::size_t size = 0;
  const double* time = nullptr;        ///< s
  const double* motor = nullptr;       ///< Nm at the shaft or A; what the motor gives
  const double* known_load = nullptr;  ///< Nm
  const double* command = nullptr;     ///< rad at the output, what a servo is told
  const double* enabled = nullptr;     ///< 0: the servo gives no torque
  const double* supply = nullptr;      ///< V, of the servo
  std::array<const double*, NumberPlaces::size()> number{};  ///< as `numbers`, of those given
  bool hold = false;  ///< the motor's column holds its value from row to row; else it is linear
};

using simulation::Ramp;

/// The inputs over a stretch without jumps, times counted from its start.
struct Inputs {
  Ramp motor;                                     ///< Nm at the shaft, or A
  Ramp known_load;                                ///< Nm
  std::array<Ramp, NumberPlaces::size()> number;  ///< as `numbers`, of those given
  double time = 0;     ///< s since the run began, at the start of the stretch
  double damping = 0;  ///< what the motor gives less for each rad/s of the output (back-EMF)
};

/// From row i to the next one.
inline Inputs inputs_from(const Signals& signals, std::size_t i) noexcept {
  const double period = signals.time[i + 1] - signals.time[i];
  Inputs in;
  in.motor = simulation::ramp(signals.motor, i, i + 1, period, 0);
  if (signals.hold) in.motor.slope = 0;
  in.known_load = simulation::ramp(signals.known_load, i, i + 1, period, 0);
  constexpr Sample<double> lacking;
  for_each_place<NumberPlaces::size()>([&](std::size_t k) {
    if (is_made(numbers<double>[k].channel)) return;
    const double absent = lacking.*numbers<double>[k].at;
    in.number[k] = simulation::ramp(signals.number[k], i, i + 1, period, absent);
  });
  in.time = signals.time[i] - signals.time[0];
  return in;
}

}  // namespace flexspline::batch::forward
