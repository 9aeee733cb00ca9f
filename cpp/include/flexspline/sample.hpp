/// One instant of a log, and the gear that relates its two sides.
#pragma once

#include <cstdint>

#include "flexspline/angle.hpp"

namespace flexspline {

/// What is known of a joint at one instant. SI units; signs as in the log format: torques are
/// positive when the joint pushes outward, the motor side is counted so that θ ≈ +Ñ q.
template <typename S>
struct Sample {
  Angle<S> output_position;   ///< q, link side
  S output_velocity = 0;      ///< rad/s
  S output_acceleration = 0;  ///< rad/s²
  Angle<S> motor_position;    ///< θ; filled from q where the joint has no motor encoder
  S temperature = 25;         ///< °C
  S known_load = 0;           ///< Nm at the output, τ_load measured by something trusted
  S motor_torque = 0;         ///< Nm at the motor's shaft, τ_m
  S period = 0;               ///< s since the last sample that was taken
  S time = 0;                 ///< s since the run began

  // Filled by Model::prepare.
  Phase<S> wave_generator_on_flexspline;
  Phase<S> wave_generator_on_circular_spline;
  S load = 0;  ///< Nm, torque that the gear transmits: known load, inertia and gravity
};

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
