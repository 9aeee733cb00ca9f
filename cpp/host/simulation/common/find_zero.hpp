/// Where a function of time passes zero, for events within a step: false position with Illinois'
/// rule, and a bisection each third round.
///
///   middle = low + s (high − low),   s = f(low) / (f(low) − f(high)), held in 0.001 … 0.999
///
/// The value at the end that stays counts half the next time, so that both ends move. Superlinear
/// where f is smooth; the bisections bound the way where f has kinks or a jump.
/// Source: [DowellJarratt1971] for Illinois' rule.
#pragma once

#include "flexspline/math.hpp"

namespace flexspline::batch::simulation {

/// f > 0 at `low`, f ≤ 0 at `high`, values given. Returns the upper end of a bracket that is at
/// most `tolerance` long, after 60 rounds at the latest: f is not above zero there.
template <typename Function>
double find_zero(const Function& f, double low, double at_low, double high, double at_high,
                 double tolerance) noexcept {
  for (int round = 0; round < 60 && high - low > tolerance && at_high < 0; ++round) {
    const double share = math::clamp(at_low / (at_low - at_high), 1e-3, 1 - 1e-3);
    const double middle = low + (round % 3 == 2 ? 0.5 : share) * (high - low);
    const double value = f(middle);
    if (value > 0) {
      low = middle;
      at_low = value;
      at_high *= 0.5;
    } else {
      high = middle;
      at_high = value;
      at_low *= 0.5;
    }
  }
  return high;
}

}  // namespace flexspline::batch::simulation
