#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "flexspline/estimators/temperature_compensation.hpp"

using namespace flexspline;

namespace {

template <typename S>
using Compensation = TemperatureCompensation<S>;

/// zhang_disturbance_elimination (24) as torque: −62.738 mNm/mV times b, from 25 °C.
template <typename S>
constexpr typename Compensation<S>::Config paper{.reference_temperature = S(25),
                                                 .coefficients = {S(0.02261), S(-0.00064)},
                                                 .low = S(20),
                                                 .high = S(45)};

template <typename S>
bool same(const typename Compensation<S>::State& a, const typename Compensation<S>::State& b) {
  return same_bits(a.body, b.body) && a.started == b.started;
}

template <typename S>
FlaggedTorque<S> step(const typename Compensation<S>::Config& config,
                      typename Compensation<S>::State& state, S temperature, S period) {
  FlaggedTorque<S> out;
  REQUIRE(Compensation<S>::step(config, state, temperature, period, out) == Status::ok);
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("without a lag the torque is the polynomial of the temperature", S, float,
                   double) {
  typename Compensation<S>::State state;
  for (S temperature = 20; temperature <= S(45); temperature += S(0.25)) {
    const double warmer = static_cast<double>(temperature) - 25;
    const auto out = step<S>(paper<S>, state, temperature, S(0.1));
    CHECK(static_cast<double>(out.torque) ==
          doctest::Approx(0.02261 * warmer - 0.00064 * warmer * warmer).epsilon(rounding<S>(8)));
    CHECK(out.flags == Flag::none);
  }
}

TEST_CASE_TEMPLATE("a temperature outside the fit is flagged", S, float, double) {
  typename Compensation<S>::State state;
  CHECK(step<S>(paper<S>, state, S(19.5), S(1)).flags == Flag::extrapolated);
  CHECK(step<S>(paper<S>, state, S(45.5), S(1)).flags == Flag::extrapolated);
  CHECK(step<S>(paper<S>, state, S(45), S(1)).flags == Flag::none);
}

TEST_CASE_TEMPLATE("the body follows a step of temperature by its lag at any period", S, float,
                   double) {
  for (const double period : {0.001, 1.0, 40.0, 500.0}) {
    auto config = paper<S>;
    config.thermal_lag = S(60);
    config.gradient = S(0.5);
    typename Compensation<S>::State state;
    step<S>(config, state, S(25), S(period));
    for (int k = 1; k <= 200; ++k) {
      const auto out = step<S>(config, state, S(35), S(period));
      const double left = 10 * std::exp(-k * period / 60), warm = 10 - left;
      const double exact = 0.02261 * warm - 0.00064 * warm * warm + 0.5 * left;
      CHECK(std::abs(static_cast<double>(out.torque) - exact) <= rounding<S>(35) * (k + 10));
    }
  }
}

TEST_CASE_TEMPLATE("the first temperature starts without a gradient", S, float, double) {
  typename Compensation<S>::Config config;
  config.gradient = S(3);
  config.thermal_lag = S(100);
  typename Compensation<S>::State state;
  CHECK(step<S>(config, state, S(40), S(1)).torque == S(0));
}

TEST_CASE_TEMPLATE("what is not finite leaves state and torque of the drift alone", S, float,
                   double) {
  auto config = paper<S>;
  config.thermal_lag = S(60);
  typename Compensation<S>::State good;
  const auto before = step<S>(config, good, S(30), S(1));
  auto state = good;
  FlaggedTorque<S> out = before;
  for (const S bad : not_finite<S>) {
    CHECK(Compensation<S>::step(config, state, bad, S(1), out) == Status::not_finite);
  }
  for (const S bad : bad_periods<S>) {
    CHECK(Compensation<S>::step(config, state, S(30), bad, out) == Status::bad_period);
  }
  const S huge = std::numeric_limits<S>::max();
  CHECK(Compensation<S>::step(config, state, huge, S(1), out) == Status::not_finite);
  CHECK(same<S>(state, good));
  CHECK(same_bits(out.torque, before.torque));
}

TEST_CASE_TEMPLATE("a drift in two parts equals the drift in one", S, float, double) {
  auto config = paper<S>;
  config.thermal_lag = S(7);
  const auto run = [&](typename Compensation<S>::State state, int from, int to) {
    for (int i = from; i < to; ++i) step<S>(config, state, S(30 + 5 * std::sin(0.1 * i)), S(0.3));
    return state;
  };
  CHECK(same<S>(run(run({}, 0, 40), 40, 100), run({}, 0, 100)));
}
