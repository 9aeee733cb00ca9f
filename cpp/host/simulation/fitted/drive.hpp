/// A fitted drive run through a log's inputs, without a look at its measured motion.
#pragma once

#include <algorithm>
#include <optional>

#include "host/simulation/fitted/servo.hpp"
#include "host/simulation/fitted/start.hpp"

namespace flexspline::batch::forward {

/// Where to write, (rows,) each; null for what nobody wants.
struct Record {
  double* position = nullptr;      ///< rad
  double* velocity = nullptr;      ///< rad/s
  double* acceleration = nullptr;  ///< rad/s²
  double* motor = nullptr;         ///< what the motor gives: Nm at the shaft, or A
  double* stuck = nullptr;         ///< 1 where friction holds the joint
};

inline void write(const Plant& plant, const Inputs& in, double late, const Motion& m,
                  std::size_t row, const Record& to) noexcept {
  if (to.position != nullptr) to.position[row] = m.position;
  if (to.velocity != nullptr) to.velocity[row] = m.velocity;
  if (to.motor != nullptr) to.motor[row] = in.motor.at(late) - in.damping * m.velocity;
  if (to.stuck != nullptr) to.stuck[row] = m.direction == 0 ? 1 : 0;
  if (to.acceleration == nullptr) return;
  Memories memories = m.memories;
  to.acceleration[row] = m.direction == 0 ? 0
                                          : plant.acceleration(in, late, m.position, m.velocity,
                                                               m.direction, memories);
}

/// Drives from `position` [rad] and `velocity` [rad/s] at the first row to the last. `steps` ≥ 1
/// from row to row. Returns how many rows are valid: fewer than there are where the motion runs
/// away to infinity.
inline std::size_t drive(const Plant& plant, const Signals& signals,
                         const std::optional<PositionServo>& servo, double position,
                         double velocity, std::size_t steps, const Record& record) noexcept {
  Motion m;
  m.position = position;
  m.velocity = velocity;
  PositionServo::State state;
  Inputs in;
  double period = 0;
  for (std::size_t row = 0; row + 1 < signals.size; ++row) {
    in = inputs_from(signals, row);
    if (servo) servo->drive(signals, row, m.position, state, in);
    if (row == 0) begin(plant, in, m);
    write(plant, in, 0, m, row, record);
    period = signals.time[row + 1] - signals.time[row];
    const double h = period / static_cast<double>(steps);
    for (std::size_t k = 0; k < steps; ++k) step(plant, in, static_cast<double>(k) * h, h, m);
    if (!math::is_finite(m.position) || !(math::absolute(m.velocity) < 1e6)) return row + 1;
  }
  write(plant, in, period, m, signals.size - 1, record);
  return signals.size;
}

}  // namespace flexspline::batch::forward
