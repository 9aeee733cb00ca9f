/// Verdicts of a step.
#pragma once

#include <cstdint>

namespace flexspline {

/// What a step found. Anything but `ok` leaves the outputs and the state as they were.
enum class [[nodiscard]] Status : std::uint8_t {
  ok = 0,
  not_finite = 1,  ///< NaN or infinity in a channel that the step reads, or in its result
  bad_period = 2,  ///< time since the last sample is zero, negative or not finite
};

}  // namespace flexspline
