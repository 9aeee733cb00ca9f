/// Sums of sinusoids of the angles between a gear's parts, for the forward simulation.
///
///   w(θ, q) = Σ a cos(o β + φ),   β the angle of a pair of parts: n_θ θ + n_q q
///
/// Angles go as integer phases, so that order 404 of a hundred turns keeps its digits.
/// Source: full_range_torque_estimation (23).
#pragma once

#include <vector>

#include "flexspline/effects/harmonics.hpp"
#include "flexspline/gear.hpp"

namespace flexspline::batch::simulation {

/// How often a pair turns for one turn of the motor and of the output.
struct Turning {
  int motor = 0;
  int output = 0;
};

constexpr Turning turning(Pair pair, OutputSpline spline) noexcept {
  switch (pair) {
    case Pair::output_on_housing:
      return {0, 1};
    case Pair::motor_on_stator:
      return {1, 0};
    case Pair::wave_generator_on_flexspline:
      return {1, spline == OutputSpline::flex ? 1 : 0};
    case Pair::wave_generator_on_circular_spline:
      return {1, spline == OutputSpline::circular ? -1 : 0};
  }
  return {};
}

struct Wave {
  double amplitude = 0;
  std::uint32_t order = 1;
  Phase<double> phase;
  Turning turning;
};

using Waves = std::vector<Wave>;

/// A sum and its derivatives by θ and by q.
struct WaveSum {
  double value = 0;
  double by_motor = 0;
  double by_output = 0;
};

inline WaveSum sum(const Waves& waves, Phase<double> theta, Phase<double> q) noexcept {
  WaveSum total;
  for (const Wave& wave : waves) {
    const auto motor = static_cast<std::uint64_t>(std::int64_t(wave.turning.motor));
    const auto output = static_cast<std::uint64_t>(std::int64_t(wave.turning.output));
    const Phase<double> beta = motor * theta + output * q;
    const auto p = (std::uint64_t(wave.order) * beta + wave.phase).phasor();
    const double slope = -wave.amplitude * wave.order * p.sine;
    total.value += wave.amplitude * p.cosine;
    total.by_motor += wave.turning.motor * slope;
    total.by_output += wave.turning.output * slope;
  }
  return total;
}

}  // namespace flexspline::batch::simulation
