/// What the tests of the estimators share: values that are no numbers, periods that are none,
/// a chain of all stages.
#pragma once

#include <array>
#include <limits>

#include "flexspline/estimators/chain.hpp"
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

/// A chain of every stage.
template <typename S>
typename Chain<S>::Config whole_chain() {
  typename Chain<S>::Config config;
  config.thermistor = {S(3.3), S(10000), S(10000), S(3435), S(25)};
  config.compensation = {.coefficients = {S(0.02), S(-0.0006)},
                         .gradient = S(0.1),
                         .thermal_lag = S(30),
                         .low = S(20),
                         .high = S(45)};
  config.sensor = true;
  config.calibration = {S(62.738), S(2.1835), S(-1), S(1.2)};
  config.observer = {S(100), Discretisation::exact};
  config.compliance = {S(15548), S(0.0487L), S(0.05L)};
  config.hysteresis = {S(2), {S(3e-6L), S(2e-6L), S(1e-6L), S(1e-6L)}};
  config.compliant_observer = {S(60), Discretisation::exact};
  config.logistic = {S(500), S(0.001L)};
  auto& collision = config.collision.emplace();
  collision.negative.fill(S(5));
  collision.positive.fill(S(5));
  config.watched = Watched::merged;
  return config;
}

}  // namespace flexspline
