/// Sticking, sliding, slipping, touching: the changes of mode inside a step.
///
/// Each mode has a function that is positive while it lasts: the speed along the direction of
/// sliding; static level minus net torque of a body that sticks; level minus torque of an element
/// that is elastic, its rate where it slips; the distance to the obstacle. A step at whose end one
/// is negative is taken back and repeated up to the zero, found (`find_zero`) to 1e-12 of the step;
/// there the mode changes and the rest of the step goes on. A body that sticks has velocity zero
/// exactly: it does not creep. A change and its reverse within one step are not seen.
#pragma once

#include "flexspline/find_zero.hpp"
#include "host/simulation/rig/step.hpp"

namespace flexspline::batch::simulation {

/// Net torque on a body that stands, and the level that holds it.
struct Rest {
  double net = 0;
  double level = 0;
};

inline Rest rest(const Joint& joint, const Torques& at, const Motion& m,
                 std::size_t body) noexcept {
  const Damping b = damping(joint, at);
  const std::size_t other = 1 - body;
  const double net = at.on[body] - (joint.rigid ? 0 : b[body][other] * m.velocity[other]);
  const int direction = net < 0 ? -1 : 1;
  const double carried = joint.rigid ? outer_load(at, m) : at.within.transmitted;
  const double load = math::absolute(carried) / (body == motor ? joint.ratio : 1);
  const double level = bare_level(joint, at, m, body, direction) +
                       load_factor(joint, body, direction) * load +
                       resistance(joint, m, body, 0).value;
  return {net, level};
}

/// True where a body has a level, or a kink, at v = 0.
inline bool may_stick(const Joint& joint, const Motion& m, std::size_t body) noexcept {
  if (m.braked && (body == motor || joint.rigid)) return true;
  if (!joint.friction[body].smooth()) return true;
  return joint.rigid && !joint.friction[motor].smooth();
}

/// The events: two bodies, the elements, the obstacle.
inline std::size_t event_count(const Joint& joint) noexcept { return joint.element_count + 3; }

/// Positive while mode j lasts.
inline double event_function(const Joint& joint, const Inputs& in, double t, Motion& m,
                             std::size_t j) noexcept {
  if (j < 2) {
    if ((joint.rigid && j == motor) || !may_stick(joint, m, j)) return 1;
    if (m.mode[j] != 0) return m.mode[j] * m.velocity[j];
    const Rest at = rest(joint, torques(joint, in, t, m), m, j);
    return at.level - math::absolute(at.net);
  }
  if (j < 2 + joint.element_count) {
    const Element& element = joint.elements[j - 2];
    if (m.slip[j - 2] == 0) return element.level - math::absolute(element_torque(joint, m, j - 2));
    const std::array<double, 2> arm = arms(element, m);
    return m.slip[j - 2] * (arm[motor] * m.velocity[motor] + arm[output] * m.velocity[output]);
  }
  if (joint.obstacle.stiffness == 0) return 1;
  const double depth = joint.obstacle.direction * (m.position[output] - joint.obstacle.angle);
  return m.contact ? depth : -depth;
}

/// A body at rest sticks where the static level holds it, else slides where it is pushed.
inline void settle(const Joint& joint, const Inputs& in, double t, Motion& m,
                   std::size_t body) noexcept {
  m.velocity[body] = 0;
  const Rest at = rest(joint, torques(joint, in, t, m), m, body);
  const int pushed = at.net < 0 ? -1 : 1;
  m.mode[body] = math::absolute(at.net) <= at.level ? 0 : pushed;
}

/// Leaves mode j for the one that follows it.
inline void change(const Joint& joint, const Inputs& in, double t, Motion& m,
                   std::size_t j) noexcept {
  if (j < 2) {
    if (m.mode[j] != 0) {
      settle(joint, in, t, m, j);
    } else {
      m.mode[j] = rest(joint, torques(joint, in, t, m), m, j).net < 0 ? -1 : 1;
    }
  } else if (j < 2 + joint.element_count) {
    const Element& element = joint.elements[j - 2];
    if (m.slip[j - 2] == 0) {
      m.slip[j - 2] = element_torque(joint, m, j - 2) < 0 ? -1 : 1;
    } else {
      m.anchor[j - 2] = stretch(element, m) - m.slip[j - 2] * element.level / element.stiffness;
      m.slip[j - 2] = 0;
    }
  } else {
    m.contact = !m.contact;
  }
}

/// How far into the step from `before` mode j lasts, at most `end`, where it is over already.
inline double locate_event(const Joint& joint, const Inputs& in, double t, double end,
                           const Motion& before, std::size_t j, double over) noexcept {
  const auto value = [&](double h) {
    Motion m = before;
    smooth_step(joint, in, t, h, m);
    return event_function(joint, in, t + h, m, j);
  };
  Motion start = before;
  double low = 0;
  double above = event_function(joint, in, t, start, j);
  if (!(above > 0)) {  // it may have just begun: at rest, at the level
    low = end / 1024;
    above = value(low);
    if (!(above > 0)) return 0;
  }
  return find_zero(value, low, above, end, over, 1e-12 * end);
}

/// Takes a body that a chain of changes left between two modes as stuck.
inline void hold_undecided(const Joint& joint, Motion& m) noexcept {
  for (std::size_t body = joint.rigid ? output : motor; body < 2; ++body) {
    if (may_stick(joint, m, body) && m.mode[body] * m.velocity[body] < 0) {
      m.velocity[body] = 0;
      m.mode[body] = 0;
    }
  }
}

/// The first change within h seconds of `before`, whose smooth end is `after`: number and time,
/// or `event_count` where there is none.
struct Event {
  std::size_t which;
  double at;
};
inline Event first_event(const Joint& joint, const Inputs& in, double t, double h,
                         const Motion& before, Motion& after) noexcept {
  Event first{event_count(joint), h};
  for (std::size_t j = 0; j < event_count(joint); ++j) {
    const double over = event_function(joint, in, t + h, after, j);
    if (!(over < 0)) continue;
    if (first.at < h) {  // over at the end of the step, but perhaps not yet at the first event
      Motion m = before;
      smooth_step(joint, in, t, first.at, m);
      const double then = event_function(joint, in, t + first.at, m, j);
      if (!(then < 0)) continue;
      first = {j, locate_event(joint, in, t, first.at, before, j, then)};
    } else {
      first = {j, locate_event(joint, in, t, h, before, j, over)};
    }
  }
  return first;
}

/// Advances by h seconds through all changes of mode; fourth order.
inline void advance(const Joint& joint, const Inputs& in, double t, double h, Motion& m) noexcept {
  constexpr int most_changes = 24;
  for (int i = 0; i < most_changes && h > 0; ++i) {
    const Motion before = m;
    smooth_step(joint, in, t, h, m);
    const Event event = first_event(joint, in, t, h, before, m);
    if (event.which == event_count(joint)) return;
    m = before;
    if (event.at > 0) smooth_step(joint, in, t, event.at, m);
    t += event.at;
    h -= event.at;
    change(joint, in, t, m, event.which);
  }
  if (h > 0) smooth_step(joint, in, t, h, m);
  hold_undecided(joint, m);
}

}  // namespace flexspline::batch::simulation
