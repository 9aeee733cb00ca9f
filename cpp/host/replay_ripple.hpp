/// What removes ripple, run over a log sample by sample as on the device. A row that a step
/// refuses repeats the last torque given out; NaN before the first.
#pragma once

#include <limits>

#include "flexspline/estimators/order_tracker.hpp"
#include "flexspline/estimators/ripple_oscillator.hpp"

namespace flexspline::batch {

inline constexpr std::size_t most_ripple_orders = 8;
inline constexpr std::size_t most_grid_angles = 256;

using Oscillator = RippleOscillator<double, most_ripple_orders>;
using Tracker = OrderTracker<double, most_grid_angles>;

inline void replay_ripple_oscillator(const double* time, const double* angle, const double* reading,
                                     std::size_t size, const Oscillator::Config& config,
                                     double* torque) noexcept {
  Oscillator::State state;
  Angle<double> at;
  double last = 0.0;
  double held = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < size; ++i) {
    if (read_radians(angle[i], at) == Status::ok && math::is_finite(time[i]) &&
        Oscillator::step(config, state, at.phase, reading[i], time[i] - last, held) == Status::ok) {
      last = time[i];
    }
    torque[i] = held;
  }
}

inline void replay_order_tracker(const double* angle, const double* reading, std::size_t size,
                                 const Tracker::Config& config, double* torque) noexcept {
  Tracker::State state;
  Angle<double> at;
  double held = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < size; ++i) {
    if (read_radians(angle[i], at) == Status::ok) {
      static_cast<void>(Tracker::step(config, state, at.phase, reading[i], held));
    }
    torque[i] = held;
  }
}

}  // namespace flexspline::batch
