/// A smooth joint goes by its series: within a row, or over many at once.
///
/// A leap is as long as its series is as accurate as wanted, and ends at the latest where the
/// torques have a kink. Rows on the way are read off the series.
#pragma once

#include "host/simulation/rig/read_off.hpp"
#include "host/simulation/rig/steps.hpp"

namespace flexspline::batch::simulation {

/// How leaps are taken, and what is remembered from one to the next.
struct Pace {
  double accuracy = 0;    ///< of the motion in a leap
  std::size_t order = 0;  ///< the largest
  double shortest = 0;    ///< s; `Options::shortest_leap`
  double reached = 0;     ///< s, of the last series that was not cut short
  double longest = 0;     ///< s, of all leaps
  Expansion expansion;
  WorkSeries work;
};

/// One leap from t, of at most `left` seconds; returns how long it was, or 0 where there is none.
template <Kind kind>
inline double leap(const Joint& joint, const Inputs& in, double t, double left, Pace& pace,
                   Motion& m, Rows& rows) noexcept {
  Expansion& e = pace.expansion;
  const double farthest = 8 * pace.reached;
  e.unit = left < farthest ? left : farthest;
  first_terms<kind>(joint, in, t, m, e);
  const double guess = pace.reached < e.unit ? pace.reached / e.unit : 1;
  const double share = expand<kind>(joint, pace.order, pace.accuracy, guess, e);
  const double gone = share * e.unit;
  if (!(gone > 0) || gone < (left < pace.shortest ? left : pace.shortest)) return 0;
  if (share < 1 || gone > pace.reached) pace.reached = gone;
  if (gone > pace.longest) pace.longest = gone;
  if (joint.accounts) work_series<kind>(joint, e, pace.work);
  if (rows.next < rows.end) read_off<kind>(joint, in, e, pace.work, t, share, m, rows);
  move<kind>(joint, e, share, m);
  if (joint.accounts) add_work(pace.work, e.order, share, m.work);
  return gone;
}

/// From t to `end`, between which the torques are straight lines.
template <Kind kind>
inline Fault leaps_of(const Joint& joint, const Inputs& in, double t, double end, Pace& pace,
                      Motion& m, Rows& rows) noexcept {
  const Fault fault = !joint.rigid && has_pole(joint.spring) ? Fault::pole : Fault::not_finite;
  while (t < end) {
    const double gone = leap<kind>(joint, in, t, end - t, pace, m, rows);
    if (!(gone > 0) || !math::is_finite(m.velocity[motor] + m.velocity[output])) return fault;
    t = gone < end - t ? t + gone : end;
  }
  return Fault::none;
}
inline Fault leaps(const Joint& joint, const Inputs& in, double t, double end, Pace& pace,
                   Motion& m, Rows& rows) noexcept {
  const bool rigid = joint.kind == Kind::smooth_rigid;
  return rigid ? leaps_of<Kind::smooth_rigid>(joint, in, t, end, pace, m, rows)
               : leaps_of<Kind::smooth_mesh>(joint, in, t, end, pace, m, rows);
}

}  // namespace flexspline::batch::simulation
