/// How a plant begins: which way it moves, and what its effects remember.
///
/// What friction that remembers had been through is not in a log. It is taken to have settled:
/// moving, by coming a long way in that direction; at rest, by coming a long way and then back, as
/// far as makes it hold the joint against what drives it, if it can.
#pragma once

#include "host/simulation/fitted/step.hpp"

namespace flexspline::batch::forward {

/// The memories of a joint that came from `position` − `way` · `reach` to `position` + `way` ·
/// `back` and from there to `position`.
inline Memories arrived(const Plant& plant, const Inputs& in, double position, int way,
                        double reach, double back) noexcept {
  Memories memories = plant.fresh();
  plant.remember(in, 0, position - way * reach, way, memories);
  plant.remember(in, 0, position + way * back, way, memories);
  plant.remember(in, 0, position, way, memories);
  return memories;
}

/// How long a way settles all memories [rad], at most what stays short of half a turn.
inline double settling_reach(const Plant& plant, const Inputs& in, double position) noexcept {
  constexpr double longest = 2.5;
  double reach = longest / 1048576;
  while (reach < longest && !plant.settled(arrived(plant, in, position, 1, reach, 0))) reach *= 2;
  return reach;
}

/// Sets direction and memories of a joint whose angle and velocity are known.
inline void begin(const Plant& plant, const Inputs& in, Motion& m) noexcept {
  const int way = m.velocity < 0 ? -1 : 1;
  m.direction = way;
  if (plant.remembers()) {
    const double reach = settling_reach(plant, in, m.position);
    m.memories = arrived(plant, in, m.position, way, reach, 0);
    const auto lacking = [&](double back) {
      const Memories memories = arrived(plant, in, m.position, 1, reach, back);
      return -plant.excess(in, 0, m.position, 1, memories) -
             plant.excess(in, 0, m.position, -1, memories);
    };
    if (m.velocity == 0 && lacking(0) > 0) {
      const double all = lacking(reach);
      const double back = all < 0 ? event_time(lacking, 0, lacking(0), reach, all) : reach;
      m.memories = arrived(plant, in, m.position, 1, reach, back);
    }
  }
  if (m.velocity == 0 && plant.turns()) m.direction = leaving(plant, in, 0, m);
}

}  // namespace flexspline::batch::forward
