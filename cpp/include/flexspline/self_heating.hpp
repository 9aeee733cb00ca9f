/// Temperature of a joint that its own losses heat: one heat capacity, and one way to the room.
///
///   C dT/dt = P − (T − T_a)/R
///   T(t + h) = T_∞ + (T(t) − T_∞) e^(−h/t_c),     T_∞ = T_a + R P,  t_c = R C
///
/// Exact for losses P that are constant over the step h, however long it is. At P = 0: T falls to
/// T_a. With R = 0 the losses heat nothing. Linear: with T and T_a counted from any temperature it
/// is the same. P < 0, as of a spring that gives back what it took, cools by as much as it had
/// heated. A joint has several capacities (windings, teeth, housing): this is the slowest of them.
///
/// R is what a joint that has run for long is warmer than the room by, over its losses; t_c the time
/// in which, at rest, all but 37 % of that is gone.
#pragma once

#include "flexspline/sample.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename S>
struct SelfHeating {
  S ambient = S(25);       ///< T_a, °C
  S resistance = S(0);     ///< R, K/W, ≥ 0
  S time_constant = S(1);  ///< t_c, s, > 0

  /// Moves `temperature` [°C] on by `period` s, over which the losses are `loss` W. What is not
  /// finite, or a period that is not above zero, changes nothing.
  constexpr Status step(S loss, S period, S& temperature) const noexcept {
    if (!is_period(period)) return Status::bad_period;
    const S end = ambient + resistance * loss;
    const S next = temperature - math::expm1_negative(period / time_constant) * (end - temperature);
    if (!math::is_finite(next)) return Status::not_finite;
    temperature = next;
    return Status::ok;
  }
};

}  // namespace flexspline
