/// What the tests of the estimators share: values that are no numbers, periods that are none.
#pragma once

#include <array>
#include <limits>

#include "flexspline/math.hpp"
#include "flexspline/status.hpp"
#include "random_samples.hpp"

namespace flexspline {

template <typename S>
inline constexpr S not_a_number = std::numeric_limits<S>::quiet_NaN();

template <typename S>
inline constexpr std::array<S, 3> not_finite{not_a_number<S>, std::numeric_limits<S>::infinity(),
                                             -std::numeric_limits<S>::infinity()};

template <typename S>
inline constexpr std::array<S, 4> bad_periods{S(0), S(-1e-3), not_a_number<S>,
                                              std::numeric_limits<S>::infinity()};

/// The relative rounding of a few operations, times `count`.
template <typename S>
double rounding(double count) {
  return count * static_cast<double>(std::numeric_limits<S>::epsilon());
}

}  // namespace flexspline
