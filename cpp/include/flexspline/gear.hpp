/// The gear that relates the two sides of a joint.
#pragma once

#include <cstdint>

#include "flexspline/angle.hpp"

namespace flexspline {

enum class OutputSpline : std::uint8_t { unknown, circular, flex };

/// The gear's effective ratio Ñ as whole turns and a fraction, and what turns against what.
///
///   θ = Ñ q;  Ñ = N + 1 where the circular spline is the output, N otherwise
template <typename S>
struct Gear {
  std::uint32_t whole_ratio = 1;
  Phase<double> ratio_fraction;  ///< in 2^−64 for a float too: turns multiply what it lacks
  OutputSpline output = OutputSpline::unknown;
  bool motor_encoder = false;  ///< false: the motor's angle is Ñ q

  /// `effective_ratio` Ñ > 0.
  static constexpr Gear from_ratio(double effective_ratio, OutputSpline output,
                                   bool motor_encoder) noexcept {
    const auto ratio = Angle<double>::from_turns(effective_ratio);
    return {static_cast<std::uint32_t>(ratio.turns), ratio.phase, output, motor_encoder};
  }

  /// The phase of Ñ q, exact to one unit of the fraction (float) or two (double).
  constexpr Phase<S> motor_phase(const Angle<S>& q) const noexcept {
    constexpr int spare = 64 - 8 * int(sizeof(S));
    const std::uint64_t phase = std::uint64_t(q.phase.fraction) << spare;
    const auto turns = static_cast<std::uint64_t>(std::int64_t(q.turns));
    const std::uint64_t theta = whole_ratio * phase + turns * ratio_fraction.fraction +
                                multiply_high(ratio_fraction.fraction, phase);
    return {static_cast<math::Bits<S>>(theta >> spare)};
  }

  /// Wave generator against flexspline: θ, or θ + q where the flexspline is the output.
  constexpr Phase<S> against_flexspline(Phase<S> q, Phase<S> theta) const noexcept {
    return output == OutputSpline::flex ? theta + q : theta;
  }

  /// Wave generator against circular spline: θ, or θ − q where the circular spline is the output.
  constexpr Phase<S> against_circular_spline(Phase<S> q, Phase<S> theta) const noexcept {
    return output == OutputSpline::circular ? theta - q : theta;
  }
};

}  // namespace flexspline
