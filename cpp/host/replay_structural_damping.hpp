/// Structural damping run over a log, sample by sample, as on the device.
#pragma once

#include <cstddef>
#include <limits>

#include "flexspline/estimators/structural_damping.hpp"

namespace flexspline::batch {

/// Torque of each row, Nm. A row that the step refuses repeats the last good torque; rows before
/// the first good one are NaN.
inline void replay_structural_damping(const double* time, const double* torsion, std::size_t size,
                                      const StructuralDamping<double>::Config& config,
                                      double* torque) noexcept {
  StructuralDamping<double>::State state;
  double held = std::numeric_limits<double>::quiet_NaN();
  std::size_t last = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const double period = state.started ? time[i] - time[last] : 1.0;
    if (math::is_finite(time[i]) &&
        StructuralDamping<double>::step(config, state, torsion[i], period, held) == Status::ok) {
      last = i;
    }
    torque[i] = held;
  }
}

}  // namespace flexspline::batch
