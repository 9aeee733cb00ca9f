/// Rows that lie on a series are read off it.
#pragma once

#include <algorithm>

#include "host/simulation/rig/record.hpp"
#include "host/simulation/rig/series_work.hpp"
#include "host/wide_loop.hpp"

namespace flexspline::batch::simulation {

/// Rows `next` … `end` − 1 are on the way and not written yet.
struct Rows {
  const double* time;
  std::size_t next;
  std::size_t end;
  const Record& record;
  bool all;  ///< more is wanted of a row than angles and velocities
};

/// out_i = a((t_i − start) / unit), of the terms up to `order`
inline void values(const Coefficients& a, std::size_t order, double start, double unit,
                   const double* time, std::size_t count, double* out) noexcept {
  run_wide([=, &a] {
    constexpr std::size_t lanes = 16;
    const double per_unit = 1 / unit;
    std::size_t i = 0;
    for (; i + lanes <= count; i += lanes) {
      std::array<double, lanes> sigma;
      std::array<double, lanes> sum;
      for (std::size_t k = 0; k < lanes; ++k) {
        sigma[k] = (time[i + k] - start) * per_unit;
        sum[k] = a[order];
      }
      for (std::size_t j = order; j > 0; --j) {
        for (std::size_t k = 0; k < lanes; ++k) sum[k] = a[j - 1] + sigma[k] * sum[k];
      }
      for (std::size_t k = 0; k < lanes; ++k) out[i + k] = sum[k];
    }
    for (; i < count; ++i) out[i] = value(a, order, (time[i] - start) * per_unit);
  });
}

/// Where the motion is at σ of a series that starts where `m` is.
template <Kind kind>
inline void move(const Joint& joint, const Expansion& e, double sigma, Motion& m) noexcept {
  for (std::size_t body = is_rigid<kind>(joint) ? output : motor; body <= output; ++body) {
    const Coefficients& v = e.velocity[body];
    m.position[body] = value(integral(v, e.order, e.unit, m.position[body]), e.order + 1, sigma);
    m.velocity[body] = value(v, e.order, sigma);
  }
}

/// Angles and velocities of the rows before `end`.
template <Kind kind>
inline void read_motion(const Joint& joint, const Expansion& e, double start, const Motion& m,
                        const Rows& rows, std::size_t end) noexcept {
  constexpr std::array<std::array<std::size_t, 2>, 2> columns{{{3, 4}, {0, 1}}};
  for (std::size_t body = motor; body <= output; ++body) {
    const bool geared = is_rigid<kind>(joint) && body == motor;
    Coefficients velocity = e.velocity[geared ? output : body];
    double position = m.position[geared ? output : body];
    if (geared) {
      position *= joint.ratio;
      for (std::size_t k = 0; k <= e.order; ++k) velocity[k] *= joint.ratio;
    }
    const auto read = [&](const Coefficients& a, std::size_t order, double* column) {
      if (column == nullptr) return;
      values(a, order, start, e.unit, rows.time + rows.next, end - rows.next, column + rows.next);
    };
    read(integral(velocity, e.order, e.unit, position), e.order + 1,
         rows.record.column[columns[body][0]]);
    read(velocity, e.order, rows.record.column[columns[body][1]]);
  }
}

/// Writes the rows up to σ = `share` of a series that starts at `start` where `m` is.
template <Kind kind>
inline void read_off(const Joint& joint, const Inputs& in, const Expansion& e,
                     const WorkSeries& work, double start, double share, const Motion& m,
                     Rows& rows) noexcept {
  const double* const first = rows.time + rows.next;
  const double* const last = rows.time + rows.end;
  const auto end =
      static_cast<std::size_t>(std::upper_bound(first, last, start + share * e.unit) - rows.time);
  if (!rows.all) read_motion<kind>(joint, e, start, m, rows, end);
  for (std::size_t row = rows.next; rows.all && row < end; ++row) {
    Motion at = m;
    const double sigma = (rows.time[row] - start) / e.unit;
    move<kind>(joint, e, sigma, at);
    if (joint.accounts) add_work(work, e.order, sigma, at.work);
    write_all(joint, in, rows.time[row], at, false, row, rows.record);
  }
  rows.next = end;
}

}  // namespace flexspline::batch::simulation
