/// The limit of a servo's output, and its integral, which does not wind up behind it.
///
///   u = clamp(w, −u_max, u_max),    I ← I + ΔI,  unless |w| > u_max and ΔI pushes further out
#pragma once

#include "flexspline/math.hpp"

namespace flexspline::batch::simulation {

/// u of one tick. `wanted`: w, which has `more`, this tick's ΔI, in it already.
constexpr double limited(double wanted, double more, double limit, double& integral) noexcept {
  const double held = math::clamp(wanted, -limit, limit);
  if (held == wanted || !(more * wanted > 0)) integral += more;
  return held;
}

}  // namespace flexspline::batch::simulation
