/// A value that changes linearly in time, and a column of values between two of its rows.
#pragma once

#include <cstddef>

namespace flexspline::batch::simulation {

struct Ramp {
  double value = 0;
  double slope = 0;

  /// `late`: s since the ramp's start.
  constexpr double at(double late) const noexcept { return value + slope * late; }
};

/// From row `first` of a column to row `last`, `width` > 0 seconds later; where there is no column,
/// the constant `absent`.
constexpr Ramp ramp(const double* column, std::size_t first, std::size_t last, double width,
                    double absent) noexcept {
  if (column == nullptr) return {absent, 0};
  return {column[first], (column[last] - column[first]) / width};
}

}  // namespace flexspline::batch::simulation
