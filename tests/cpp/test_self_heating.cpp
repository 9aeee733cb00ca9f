#include <doctest/doctest.h>

#include <cmath>

#include "estimator_cases.hpp"
#include "flexspline/self_heating.hpp"

using namespace flexspline;

TEST_CASE_TEMPLATE("a constant loss warms along an exponential, however long the steps", S, float,
                   double) {
  const SelfHeating<S> joint{S(20), S(1.5L), S(600)};
  for (const S period : {S(0.5L), S(7), S(300), S(3000)}) {
    S temperature = S(22);
    double time = 0;
    for (int k = 0; k < 400; ++k) {
      REQUIRE(joint.step(S(10), period, temperature) == Status::ok);
      time += double(period);
    }
    const double expected = 35 - 13 * std::exp(-time / 600);
    // 400 steps, each off by the rounding of a temperature
    CHECK(double(temperature) == doctest::Approx(expected).epsilon(rounding<S>(400)));
  }
}

TEST_CASE("half of the steps twice as long give the same temperature") {
  const SelfHeating<double> joint{25, 0.8, 1234};
  double once = 40, twice = 40;
  REQUIRE(joint.step(30, 50, once) == Status::ok);
  REQUIRE(joint.step(30, 25, twice) == Status::ok);
  REQUIRE(joint.step(30, 25, twice) == Status::ok);
  CHECK(once == doctest::Approx(twice).epsilon(1e-15));
}

TEST_CASE("without losses it cools to the room, and without resistance losses heat nothing") {
  SelfHeating<double> joint{18, 0, 60};
  double temperature = 50;
  REQUIRE(joint.step(1e9, 60, temperature) == Status::ok);
  CHECK(temperature == doctest::Approx(18 + 32 / std::exp(1.0)).epsilon(1e-14));
  REQUIRE(joint.step(0, 3600, temperature) == Status::ok);
  CHECK(temperature == doctest::Approx(18).epsilon(1e-14));
}

TEST_CASE("the energy that came in is in the joint or has gone to the room") {
  const SelfHeating<double> joint{25, 1.2, 480};
  const double capacity = joint.time_constant / joint.resistance;
  double temperature = 25, in = 0, out = 0;
  for (int k = 0; k < 200000; ++k) {
    const double loss = 8 + 6 * std::sin(k * 1e-3), before = temperature;
    REQUIRE(joint.step(loss, 0.01, temperature) == Status::ok);
    in += 0.01 * loss;
    out += 0.01 * (0.5 * (before + temperature) - 25) / joint.resistance;
  }
  CHECK(capacity * (temperature - 25) + out == doctest::Approx(in).epsilon(1e-9));
}

TEST_CASE_TEMPLATE("what is no loss and no period changes nothing", S, float, double) {
  const SelfHeating<S> joint{S(20), S(1.5L), S(600)};
  S temperature = S(31);
  for (const S bad : not_finite<S>) {
    CHECK(joint.step(bad, S(1), temperature) == Status::not_finite);
  }
  for (const S bad : bad_periods<S>) {
    CHECK(joint.step(S(1), bad, temperature) == Status::bad_period);
  }
  CHECK(temperature == S(31));
  S lost = not_a_number<S>;
  CHECK(joint.step(S(1), S(1), lost) == Status::not_finite);
}
