/// Energies that go through a joint while its motion is a series: integrals of products of series.
#pragma once

#include "host/simulation/rig/expansion.hpp"

namespace flexspline::batch::simulation {

/// `Work` since the start of a series, zero there.
struct WorkSeries {
  std::array<Coefficients, 2> friction{};
  Coefficients gear{}, motor{}, load{}, copper{};
};

/// Term k of a b, b linear.
constexpr double product(const Coefficients& a, const Ramp& b, std::size_t k) noexcept {
  return a[k] * b.value + (k > 0 ? a[k - 1] * b.slope : 0);
}

/// To as many terms as the velocities have.
template <Kind kind>
inline void work_series(const Joint& joint, const Expansion& e, WorkSeries& w) noexcept {
  const Coefficients& v = e.velocity[output];
  const double turns = is_rigid<kind>(joint) ? joint.ratio : 1;
  const Coefficients& rotor = e.velocity[is_rigid<kind>(joint) ? output : motor];
  const auto [at_start, rise] = e.motor_torque;
  const std::array<double, 3> heating{at_start * at_start, 2 * at_start * rise, rise * rise};
  Coefficients slip;
  for (std::size_t k = 0; k < e.order; ++k) {
    const double part = e.unit * reciprocal[k + 1];
    w.motor[k + 1] = part * turns * product(rotor, e.motor_torque, k);
    w.load[k + 1] = part * product(v, e.load, k);
    w.friction[output][k + 1] = part * product(e.friction[output], v, k);
    const double squared = k < heating.size() ? heating[k] : 0;
    w.copper[k + 1] = part * joint.thermal.copper_loss * squared;
    if constexpr (kind == Kind::smooth_rigid) continue;
    w.friction[motor][k + 1] = part * product(e.friction[motor], rotor, k);
    slip[k] = rotor[k] * joint.inverse_ratio - v[k];
    w.gear[k + 1] = part * joint.damping * square(slip, k);
  }
}

/// Adds what went through up to σ, of a series with velocities of this order.
inline void add_work(const WorkSeries& series, std::size_t order, double sigma,
                     Work& work) noexcept {
  for (std::size_t body = motor; body <= output; ++body) {
    work.friction[body] += value(series.friction[body], order, sigma);
  }
  work.gear += value(series.gear, order, sigma);
  work.motor += value(series.motor, order, sigma);
  work.load += value(series.load, order, sigma);
  work.copper += value(series.copper, order, sigma);
}

}  // namespace flexspline::batch::simulation
