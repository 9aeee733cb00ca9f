/// An encoder: angles in whole steps.
#pragma once

#include <cmath>

namespace flexspline::batch::simulation {

struct Encoder {
  double step = 0;  ///< rad; 0: exact

  /// The last count that was passed, rad: what a counter of edges shows.
  double below(double angle) const noexcept {
    return step > 0 ? std::floor(angle / step) * step : angle;
  }
  /// The nearest count, rad: what is written in a log.
  double nearest(double angle) const noexcept { return below(angle + 0.5 * step); }
};

}  // namespace flexspline::batch::simulation
