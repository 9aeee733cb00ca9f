/// One step of a plant: Runge and Kutta's method of fourth order between events.
///
/// Events are where the velocity passes zero (the step is cut there, to rounding) and where a joint
/// that sticks breaks away. On arcs without events the error of a step is of fifth order; a cut
/// adds one of fourth order, once. Where a presliding spring starts to slip within a step, q̈ has a
/// kink there, which costs orders in that step alone.
#pragma once

#include "flexspline/find_zero.hpp"
#include "host/simulation/fitted/plant.hpp"

namespace flexspline::batch::forward {

/// All that moves. `direction` is that of the motion, 0 while friction holds the joint.
struct Motion {
  double position = 0;
  double velocity = 0;
  int direction = 1;
  Memories memories{};
};

/// Angle and velocity a step later.
struct Moved {
  double position;
  double velocity;
};

/// Classical fourth order, from `late` on for h seconds; the memories stay as they are.
inline Moved runge_kutta(const Plant& plant, const Inputs& in, double late, double h,
                         Motion& m) noexcept {
  const auto slope = [&](double after, double position, double velocity) {
    if (!plant.remembers()) {
      return plant.acceleration(in, late + after, position, velocity, m.direction, m.memories);
    }
    Memories moved = m.memories;
    return plant.acceleration(in, late + after, position, velocity, m.direction, moved);
  };
  const double half = 0.5 * h;
  const double q = m.position;
  const double v1 = m.velocity;
  const double a1 = slope(0, q, v1);
  const double v2 = v1 + half * a1;
  const double a2 = slope(half, q + half * v1, v2);
  const double v3 = v1 + half * a2;
  const double a3 = slope(half, q + half * v2, v3);
  const double v4 = v1 + h * a3;
  const double a4 = slope(h, q + h * v3, v4);
  return {q + h / 6 * (v1 + 2 * (v2 + v3) + v4), v1 + h / 6 * (a1 + 2 * (a2 + a3) + a4)};
}

/// Where an event function that is above zero at `low` and not at `high` passes zero, to rounding.
template <typename Function>
double event_time(const Function& f, double low, double at_low, double high,
                  double at_high) noexcept {
  return find_zero(f, low, at_low, high, at_high, 1e-13 * high);
}

/// Which way a joint at rest goes: 0 where friction holds it.
inline int leaving(const Plant& plant, const Inputs& in, double late, const Motion& m) noexcept {
  const double forward = plant.excess(in, late, m.position, 1, m.memories);
  const double backward = plant.excess(in, late, m.position, -1, m.memories);
  if (forward > 0 && forward + backward >= 0) return 1;
  if (backward < 0) return -1;
  return forward > 0 ? 1 : 0;
}

/// A joint that sticks: returns how long it does, at most h; then it has its new direction.
inline double hold(const Plant& plant, const Inputs& in, double late, double h,
                   Motion& m) noexcept {
  const int way = leaving(plant, in, late + h, m);
  if (way == 0) return h;
  const auto kept = [&](double after) {
    return -way * plant.excess(in, late + after, m.position, way, m.memories);
  };
  const double now = kept(0);
  m.direction = way;
  return now > 0 ? event_time(kept, 0, now, h, kept(h)) : 0;
}

/// The length of a step that ends at rest, within one of length h that goes beyond; 0 where it
/// begins at rest and does not get away.
inline double until_rest(const Plant& plant, const Inputs& in, double late, double h, double beyond,
                         Motion& m) noexcept {
  const auto along = [&](double length) {
    return m.direction * runge_kutta(plant, in, late, length, m).velocity;
  };
  double low = 0;
  double at_low = m.direction * m.velocity;
  double high = h;
  for (int halving = 0; !(at_low > 0) && halving < 40; ++halving) {
    const double length = 0.5 * high;
    const double value = along(length);
    if (value > 0) {
      low = length;
      at_low = value;
    } else {
      high = length;
      beyond = value;
    }
  }
  return at_low > 0 ? event_time(along, low, at_low, high, beyond) : 0;
}

/// A joint that moves: returns how far in time it got, at most h; at rest it has found its new
/// direction.
inline double move(const Plant& plant, const Inputs& in, double late, double h,
                   Motion& m) noexcept {
  double length = h;
  Moved to = runge_kutta(plant, in, late, h, m);
  const bool rests = plant.turns() && !(m.direction * to.velocity > 0);
  if (rests) {
    length = until_rest(plant, in, late, h, m.direction * to.velocity, m);
    to = length > 0 ? runge_kutta(plant, in, late, length, m) : Moved{m.position, 0};
    to.velocity = 0;
  }
  m.position = to.position;
  m.velocity = to.velocity;
  plant.remember(in, late + length, m.position, m.direction, m.memories);
  if (rests) m.direction = leaving(plant, in, late + length, m);
  return length;
}

inline constexpr int most_events = 64;  ///< in one step; then friction holds for its rest

/// One step of h seconds.
inline void step(const Plant& plant, const Inputs& in, double late, double h, Motion& m) noexcept {
  const double end = late + h;
  for (int event = 0; event < most_events && end - late > 1e-12 * h; ++event) {
    const double rest = end - late;
    late += m.direction == 0 ? hold(plant, in, late, rest, m) : move(plant, in, late, rest, m);
  }
}

}  // namespace flexspline::batch::forward
