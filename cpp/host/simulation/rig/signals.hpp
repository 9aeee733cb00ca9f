/// What drives a joint, in columns, and where their torques are straight lines.
#pragma once

#include <algorithm>

#include "host/simulation/rig/joint.hpp"
#include "host/wide_loop.hpp"

namespace flexspline::batch::simulation {

/// Columns of inputs; null where nothing is given. The time increases strictly.
struct Signals {
  const double* time = nullptr;
  std::size_t size = 0;
  const double* motor_torque = nullptr;      ///< Nm; the servo's feed-forward where there is one
  const double* load_torque = nullptr;       ///< Nm
  const double* room_temperature = nullptr;  ///< °C
  const double* position_command = nullptr;  ///< rad
  const double* velocity_command = nullptr;  ///< rad/s
  bool hold = false;  ///< torques hold their value from row to row instead of changing linearly
};

inline double at_or(const double* column, std::size_t row, double otherwise) noexcept {
  return column != nullptr ? column[row] : otherwise;
}

/// Inputs from row i on, up to row `last`.
inline Inputs inputs_of(const Signals& s, std::size_t i, std::size_t last) noexcept {
  if (s.hold || last <= i) {
    return {s.time[i], {at_or(s.motor_torque, i, 0), 0}, {at_or(s.load_torque, i, 0), 0}};
  }
  const double width = s.time[last] - s.time[i];
  return {s.time[i], ramp(s.motor_torque, i, last, width, 0),
          ramp(s.load_torque, i, last, width, 0)};
}

/// The largest of of(0) … of(count − 1), none of them negative; 0 for none.
template <typename Of>
inline double largest(std::size_t count, const Of& of) noexcept {
  constexpr std::size_t lanes = 64;
  double most = 0;
  run_wide([&most, of, count] {
    std::array<double, lanes> found{};
    std::size_t k = 0;
    for (; k + lanes <= count; k += lanes) {
      for (std::size_t j = 0; j < lanes; ++j) {
        const double value = of(k + j);
        found[j] = found[j] < value ? value : found[j];
      }
    }
    for (; k < count; ++k) found[0] = found[0] < of(k) ? of(k) : found[0];
    most = *std::max_element(found.begin(), found.end());
  });
  return most;
}

/// A column is a straight line where no row is further from it than the rounding of its largest
/// value: four times 2⁻⁵² of that.
inline double straightness(const double* column, std::size_t size) noexcept {
  if (column == nullptr) return 0;
  return 4 * std::numeric_limits<double>::epsilon() *
         largest(size, [column](std::size_t k) { return math::absolute(column[k]); });
}

/// True where rows i + 1 … last − 1 of a column are on the line from row i.
inline bool straight(const double* time, const double* column, std::size_t i, std::size_t last,
                     Ramp line, double tolerance) noexcept {
  constexpr std::size_t block = 512;
  if (column == nullptr) return true;
  const auto off = [=](std::size_t row) {
    return math::absolute(column[row] - line.at(time[row] - time[i]));
  };
  if (off(i + (last - i) / 2) > tolerance) return false;
  for (std::size_t first = i + 1; first < last; first += block) {
    const std::size_t count = last - first < block ? last - first : block;
    if (largest(count, [=](std::size_t k) { return off(first + k); }) > tolerance) return false;
  }
  return true;
}

/// Finds how far both torques are straight lines; remembers how far that was the last time.
struct Straight {
  double motor_tolerance = 0;  ///< Nm
  double load_tolerance = 0;   ///< Nm
  std::size_t rows = 0;        ///< to try next

  static Straight of(const Signals& s) noexcept {
    return {straightness(s.motor_torque, s.size), straightness(s.load_torque, s.size), s.size};
  }

  /// The last row of a straight stretch from row i on.
  std::size_t last(const Signals& s, std::size_t i) noexcept {
    std::size_t count = s.size - 1 - i < rows ? s.size - 1 - i : rows;
    for (; count > 1; count /= 2) {
      const Inputs in = inputs_of(s, i, i + count);
      if (straight(s.time, s.motor_torque, i, i + count, in.motor_torque, motor_tolerance) &&
          straight(s.time, s.load_torque, i, i + count, in.load, load_tolerance)) {
        break;
      }
    }
    rows = 2 * count;
    return i + (count > 1 ? count : 1);
  }
};

}  // namespace flexspline::batch::simulation
