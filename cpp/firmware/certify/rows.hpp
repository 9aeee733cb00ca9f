/// What certify's program reads and writes, row by row, in memory's own byte order (little-endian).
///
/// `ROW` and `RESULT` in python/flexspline/certification/program.py lay them out alike.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexspline/sample.hpp"

namespace certify {

/// One period's readings; NaN is missing.
template <typename S>
struct Row {
  std::array<S, flexspline::numbers<S>.size()> numbers;
  std::array<S, flexspline::instruments<S>.size()> instruments;
  S known_load;
  std::array<flexspline::math::Bits<S>, 2> fractions;  ///< of a turn: q, θ
  std::array<std::int32_t, 2> turns;                   ///< q, θ
  std::uint32_t marks;                                 ///< bits of Mark
  std::uint32_t spare;
};

enum Mark : std::uint32_t { fresh = 1, has_output_position = 2, has_motor_position = 4 };

/// Outputs after one step. A part's model has the first value alone; of a chain the last eight are
/// its adapted coefficients.
template <typename S>
struct Result {
  std::array<S, 16> values;
  std::uint16_t missed;
  std::uint8_t contact, flags, faults, status;
  std::uint16_t spare;
  std::uint32_t ticks;  ///< of the board's clock in the step, its reading taken off; 0 on a host
  std::uint32_t unused;
};

/// Behind the last result.
struct Footer {
  std::uint32_t stack_bytes;  ///< that the steps used, painted; 0 on a host
};

/// Two fractions are as long as two numbers; no byte is left between.
template <typename S>
inline constexpr std::size_t row_bytes =
    sizeof(S) * (flexspline::numbers<S>.size() + flexspline::instruments<S>.size() + 3) + 16;
static_assert(sizeof(Row<float>) == row_bytes<float> && sizeof(Row<double>) == row_bytes<double>);
static_assert(sizeof(Result<float>) == 80 && sizeof(Result<double>) == 144);

}  // namespace certify
