/// Many steps in a row, by the leanest code that knows all that the joint can meet.
///
/// A joint without events, waves and lost motion is stepped by code in which they do not occur: the
/// kind of a joint and the order are template arguments, chosen once a stretch.
#pragma once

#include "host/simulation/rig/events.hpp"

namespace flexspline::batch::simulation {

enum class Fault : std::uint8_t {
  none = 0,
  pole = 1,        ///< the gear's wind-up passed the end of its spring
  not_finite = 2,  ///< the motion grew without bound
  unstable = 3,    ///< ω h reached the limit of stability
};

/// `count` steps of h seconds from t, as long as ω h stays below `coarsest` and stable, of a joint
/// that is of this kind and meets no event, or of any.
template <Kind kind, int order, bool events>
inline Fault steps(const Joint& joint, const Inputs& in, double t, double h, std::int64_t count,
                   double coarsest, Motion& m, double& stiffest) noexcept {
  constexpr double last = composition<order>.limit;
  const double limit = coarsest < last ? coarsest : last;
  const double steep = h * h * joint.spread;
  for (std::int64_t k = 0; k < count; ++k) {
    const double now = t + static_cast<double>(k) * h;
    if constexpr (events) {
      advance(joint, in, now, h, m);
    } else {
      smooth_step<kind, order>(joint, in, now, h, m);
    }
    if (!math::is_finite(m.velocity[motor] + m.velocity[output])) {
      return !joint.rigid && has_pole(joint.spring) ? Fault::pole : Fault::not_finite;
    }
    if (is_rigid<kind>(joint)) continue;
    if (m.spring.stiffness > stiffest) stiffest = m.spring.stiffness;
    if (steep * m.spring.stiffness > limit * limit) return Fault::unstable;
  }
  return Fault::none;
}

/// The one of them that fits.
using StepsFunction = Fault (*)(const Joint&, const Inputs&, double, double, std::int64_t, double,
                                Motion&, double&) noexcept;
inline StepsFunction steps_for(const Joint& joint, int order, bool braked) noexcept {
  if (!joint.eventless || braked) return steps<Kind::anything, 4, true>;
  const bool sixth = order == 6;
  switch (joint.kind) {
    case Kind::smooth_rigid:
      return sixth ? steps<Kind::smooth_rigid, 6, false> : steps<Kind::smooth_rigid, 4, false>;
    case Kind::smooth_mesh:
      return sixth ? steps<Kind::smooth_mesh, 6, false> : steps<Kind::smooth_mesh, 4, false>;
    case Kind::anything:
      break;
  }
  return sixth ? steps<Kind::anything, 6, false> : steps<Kind::anything, 4, false>;
}

}  // namespace flexspline::batch::simulation
