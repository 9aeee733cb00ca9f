/// Friction of one side of a joint, as the forward simulation sees it: a true sign, no smoothing.
///
///   sliding   τ = −s (c_s γ_c + m_s |τ_g| + b γ_c e^(−(v/v_s)²) + γ_v (d₁ |v| + d₂ |v|² + d₃ |v|³))
///   static    any torque up to  c_s γ_c + m_s |τ_g| + b γ_c
///             γ_c = e^(−k_c (T − T₀)),   γ_v = e^(−k_v (T − T₀))
///
/// s is the direction of motion, τ_g the torque that the gear transmits, at this side. The static
/// level is the sliding one at v = 0, so that a body leaves its rest without a jump. Stribeck's law is that of
/// the catalogue, in which otherwise the sign is smoothed and temperature enters as a polynomial: a
/// simulated joint is more than the model fitted to it.
/// Source: full_range_torque_estimation (21), (22) for direction and polynomial; [Olsson1998]
/// for Stribeck; [Madsen2020] for the load.
#pragma once

#include "flexspline/effects/stribeck_friction.hpp"

namespace flexspline::batch::simulation {

struct Friction {
  double coulomb_forward = 0;         ///< Nm, ≥ 0
  double coulomb_backward = 0;        ///< Nm, ≥ 0
  double load_forward = 0;            ///< 1, Nm of friction for each Nm transmitted
  double load_backward = 0;           ///< 1
  double stribeck = 0;                ///< Nm, ≥ 0, on top of Coulomb at rest
  double stribeck_velocity = 0.1;     ///< rad/s, > 0
  double viscous = 0;                 ///< Nm s/rad
  double quadratic = 0;               ///< Nm s²/rad²
  double cubic = 0;                   ///< Nm s³/rad³
  double coulomb_fade = 0;            ///< 1/K
  double viscous_fade = 0;            ///< 1/K
  double reference_temperature = 25;  ///< °C

  constexpr bool has_level() const noexcept {
    return coulomb_forward > 0 || coulomb_backward > 0 || load_forward > 0 || load_backward > 0 ||
           stribeck > 0;
  }
  /// True where the torque is smooth through v = 0.
  constexpr bool smooth() const noexcept { return !has_level() && quadratic == 0; }
  constexpr bool none() const noexcept { return smooth() && viscous == 0 && cubic == 0; }
  constexpr double coulomb(int direction) const noexcept {
    return direction < 0 ? coulomb_backward : coulomb_forward;
  }
  constexpr double load_factor(int direction) const noexcept {
    return direction < 0 ? load_backward : load_forward;
  }
};

/// γ_c and γ_v.
struct Warmth {
  double coulomb = 1;
  double viscous = 1;
};

inline Warmth warmth(const Friction& friction, double temperature) noexcept {
  const double above = temperature - friction.reference_temperature;
  return {friction.coulomb_fade == 0 ? 1 : math::exp(-friction.coulomb_fade * above),
          friction.viscous_fade == 0 ? 1 : math::exp(-friction.viscous_fade * above)};
}

/// A torque as a function of w = s v, with what a step needs of its slope.
struct Resistance {
  double value = 0;
  double first = 0;   ///< d/dw
  double second = 0;  ///< d²/dw²
  double third = 0;   ///< d³/dw³
};

/// What grows with the velocity w ≥ 0 of one side: linear · w + quadratic · w² + cubic · w³.
struct Viscous {
  double linear = 0;
  double quadratic = 0;
  double cubic = 0;
};

constexpr Viscous viscous(const Friction& friction, const Warmth& warm) noexcept {
  return {warm.viscous * friction.viscous, warm.viscous * friction.quadratic,
          warm.viscous * friction.cubic};
}

/// The same of a side without a level or quadratic part, so also of v < 0, that turns `ratio` times
/// as fast as the coordinate v.
constexpr Viscous smooth_friction(const Friction& friction, const Warmth& warm,
                                  double ratio) noexcept {
  const Viscous own = viscous(friction, warm);
  const double r2 = ratio * ratio;
  return {own.linear * r2, 0, own.cubic * (r2 * r2)};
}

/// Adds what depends on velocity, of a side that turns `ratio` times as fast as the coordinate w.
/// The level at rest, without Stribeck, is not in it.
inline void add_resistance(const Friction& friction, const Warmth& warm, double ratio, double w,
                           Resistance& sum) noexcept {
  const double at = ratio * w;
  const auto [d1, d2, d3] = viscous(friction, warm);
  double value = at * (d1 + at * (d2 + at * d3));
  double first = d1 + at * (2 * d2 + 3 * at * d3);
  double second = 2 * d2 + 6 * at * d3;
  double third = 6 * d3;
  const double x = friction.stribeck > 0 ? at / friction.stribeck_velocity : 8;
  if (x * x < 50) {  // 2e-22 of the level is left there
    const double inverse = 1 / friction.stribeck_velocity;
    const double hump =
        warm.coulomb * friction.stribeck * stribeck_share(at, friction.stribeck_velocity);
    value += hump;
    first -= 2 * x * inverse * hump;
    second += (4 * x * x - 2) * inverse * inverse * hump;
    third += (12 - 8 * x * x) * x * inverse * inverse * inverse * hump;
  }
  sum.value += ratio * value;
  sum.first += ratio * ratio * first;
  sum.second += ratio * ratio * ratio * second;
  sum.third += ratio * ratio * ratio * ratio * third;
}

}  // namespace flexspline::batch::simulation
