/// Series steps of a smooth joint: within a row, or over many at once.
///
/// A step is as long as its series is as accurate as wanted, and ends at the latest where the
/// torques have a kink. Rows on the way are read off the series.
#pragma once

#include "host/simulation/rig/read_off.hpp"
#include "host/simulation/rig/steps.hpp"

namespace flexspline::batch::simulation {

/// How series steps are taken, and what is remembered from one to the next.
struct SeriesStepControl {
  double accuracy = 0;    ///< of the motion in a step
  std::size_t order = 0;  ///< the largest
  double shortest = 0;    ///< s; `Options::shortest_series_step`
  double radius = 0;      ///< s, of convergence, of the last series that was not cut short
  double longest = 0;     ///< s, of all steps
  Expansion expansion;
  WorkSeries work;
};

/// One step from t, of at most `left` seconds; returns how long it was, or 0 where there is none.
template <Kind kind>
inline double series_step(const Joint& joint, const Inputs& in, double t, double left,
                          SeriesStepControl& control, Motion& m, Rows& rows) noexcept {
  Expansion& e = control.expansion;
  const double farthest = 8 * control.radius;
  e.unit = left < farthest ? left : farthest;
  first_terms<kind>(joint, in, t, m, e);
  const double guess = control.radius < e.unit ? control.radius / e.unit : 1;
  const double share = expand<kind>(joint, control.order, control.accuracy, guess, e);
  const double gone = share * e.unit;
  if (!(gone > 0) || gone < (left < control.shortest ? left : control.shortest)) return 0;
  if (share < 1 || gone > control.radius) control.radius = gone;
  if (gone > control.longest) control.longest = gone;
  if (joint.accounts) work_series<kind>(joint, e, control.work);
  if (rows.next < rows.end) read_off<kind>(joint, in, e, control.work, t, share, m, rows);
  move<kind>(joint, e, share, m);
  if (joint.accounts) add_work(control.work, e.order, share, m.work);
  return gone;
}

/// From t to `end`, between which the torques are straight lines.
template <Kind kind>
inline Fault series_steps_of(const Joint& joint, const Inputs& in, double t, double end,
                             SeriesStepControl& control, Motion& m, Rows& rows) noexcept {
  const Fault fault = !joint.rigid && has_pole(joint.spring) ? Fault::pole : Fault::not_finite;
  while (t < end) {
    const double gone = series_step<kind>(joint, in, t, end - t, control, m, rows);
    if (!(gone > 0) || !math::is_finite(m.velocity[motor] + m.velocity[output])) return fault;
    t = gone < end - t ? t + gone : end;
  }
  return Fault::none;
}
inline Fault series_steps(const Joint& joint, const Inputs& in, double t, double end,
                          SeriesStepControl& control, Motion& m, Rows& rows) noexcept {
  const bool rigid = joint.kind == Kind::smooth_rigid;
  return rigid ? series_steps_of<Kind::smooth_rigid>(joint, in, t, end, control, m, rows)
               : series_steps_of<Kind::smooth_mesh>(joint, in, t, end, control, m, rows);
}

}  // namespace flexspline::batch::simulation
