/// Sine and tangent for the simulation's inner loop, where only the latency counts.
///
/// A kick waits for the torque of the gear and of gravity. `math` takes any angle in the same bits
/// everywhere; here the angle is near the last one, or known to be below a quarter turn, and the
/// polynomials are split so that their halves run side by side. Errors ≤ 4e-16 of the value
/// (tangent, and of what its argument's rounding does beside the pole) and 4e-16 (sine).
/// Source: Lambert's continued fraction of the tangent, cut after 17: 9e-19.
#pragma once

#include "flexspline/angle.hpp"

namespace flexspline::batch::simulation {

/// tan x, |x| < π/2, by one division.
constexpr double near_tangent(double x) noexcept {
  const double size = math::absolute(x);
  const bool far = size > math::pi<double> / 4;
  const double y = far ? (math::pi<double> / 2 - size) + 6.123233995736766e-17 : size;
  const double z = y * y;
  const double z2 = z * z;
  const double above =
      y * ((1 - 7.0 / 51 * z) + z2 * ((1.0 / 255 - 2.0 / 69615 * z) + z2 * (1.0 / 34459425)));
  const double below =
      (1 - 8.0 / 17 * z) + z2 * ((7.0 / 255 - 4.0 / 9945 * z) + z2 * (1.0 / 765765));
  const double tangent = (far ? below : above) / (far ? above : below);
  return x < 0 ? -tangent : tangent;
}

/// An angle with its sine and cosine; the next one is expected near it.
struct NearSine {
  double angle = 1e300;  ///< rad; 1e300: none yet
  double sine = 0;
  double cosine = 1;
};

/// sin x; `p` moves to x where that is more than 1/8 rad away.
inline double near_sine(double x, NearSine& p) noexcept {
  const double d = x - p.angle;
  if (!(math::absolute(d) < 0.125)) {
    const auto phasor = Angle<double>::from_radians(x).phase.phasor();
    p = {x, phasor.sine, phasor.cosine};
    return p.sine;
  }
  const double z = d * d;
  const double z2 = z * z;
  const double sine =
      d + d * z * ((-1.0 / 6 + z * (1.0 / 120)) + z2 * (-1.0 / 5040 + z * (1.0 / 362880)));
  const double versine = z * ((-0.5 + z * (1.0 / 24)) +
                              z2 * ((-1.0 / 720 + z * (1.0 / 40320)) - z2 * (1.0 / 3628800)));
  return p.sine + (p.cosine * sine + p.sine * versine);
}

}  // namespace flexspline::batch::simulation
