/// Estimators run over a log, sample by sample, as on the device.
#pragma once

#include <cstddef>

#include "flexspline/estimators/differentiator.hpp"

namespace flexspline::batch {

/// Velocity and acceleration of each row by the causal differentiator. A row whose position is
/// not finite, or whose time does not move on, repeats the last good values.
inline void replay_differentiator(const double* time, const double* position, std::size_t size,
                                  const Differentiator<double>::Config& config, double* velocity,
                                  double* acceleration) noexcept {
  Differentiator<double>::State state;
  Angle<double> angle;
  std::size_t last = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const double period = state.started ? time[i] - time[last] : 1.0;
    if (math::is_finite(time[i]) && read_radians(position[i], angle) == Status::ok &&
        Differentiator<double>::step(config, state, angle.phase, period) == Status::ok) {
      last = i;
    }
    velocity[i] = state.velocity;
    acceleration[i] = state.acceleration;
  }
}

}  // namespace flexspline::batch
