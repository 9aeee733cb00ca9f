/// What every effect is made of: terms, shapes and a row.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "flexspline/sample.hpp"

namespace flexspline {

/// The numbers that a coefficient each multiplies; torque = row · coefficients.
template <typename S, std::size_t N>
using Row = std::array<S, N>;

/// A coefficient's name, and its unit where the target is a torque in Nm.
struct Term {
  std::string_view name;
  std::string_view unit;
};

/// A field that bends an effect's row; fitted by an outer search, or only stored.
template <typename Effect, typename S>
struct Shape {
  std::string_view name;
  std::string_view unit;
  S Effect::* field;
  S lower;
  S upper;
  bool fitted;  ///< false: a convention, such as a reference temperature
};

/// What an effect reads of a sample.
enum class Channel : unsigned char {
  output_position,
  output_velocity,
  output_acceleration,
  motor_position,
  temperature,
  load,  ///< the transmitted torque, filled by the model
};

/// Which way the joint moves: −1 … 1, through 0 at rest.
///
///   d(v) = tanh(v / v_d)
///
/// The sigmoids of turlapati_intrinsic_dynamics (9) with slope α are (1 ± d)/2, v_d = 2/α.
template <typename S>
constexpr S direction(S velocity, S width) noexcept {
  return math::tanh(velocity / width);
}

}  // namespace flexspline
