#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "flexspline/estimators/structural_damping.hpp"

using namespace flexspline;

namespace {

template <typename S>
S last_of(const typename StructuralDamping<S>::Config& config, double period, int count,
          double (*torsion)(double)) {
  typename StructuralDamping<S>::State state;
  S torque = 0;
  for (int i = 0; i < count; ++i) {
    REQUIRE(StructuralDamping<S>::step(config, state, S(torsion(i * period)), S(period), torque) ==
            Status::ok);
  }
  return torque;
}

}  // namespace

TEST_CASE_TEMPLATE("a steady rate of torsion gives minus the damping times it", S, float, double) {
  const double period = 1e-3, time_constant = 0.2;
  const auto torque = last_of<S>({S(3000), S(time_constant), S(0.5), S(0)}, period, 5001,
                                 [](double t) { return -2e-4 * t; });
  // 5 s are 25 time constants; a float position has 6e-11 of error, of 2e-7 a step
  const double exact = 0.5 + 3000 * 2e-4;
  CHECK(std::abs(double(torque) - exact) <= (sizeof(S) == 4 ? 1e-3 : 1e-9));
}

TEST_CASE("a step of torsion is a spring at once and is forgotten with the time constant") {
  const double period = 1e-3, time_constant = 0.5, damping = 5000, size = -1e-3;
  StructuralDamping<double>::State state;
  const StructuralDamping<double>::Config config{damping, time_constant, 0, 0};
  double torque = -1;
  REQUIRE(StructuralDamping<double>::step(config, state, 0, period, torque) == Status::ok);
  CHECK(torque == 0);
  for (int i = 1; i <= 1000; ++i) {
    REQUIRE(StructuralDamping<double>::step(config, state, size, period, torque) == Status::ok);
    const double first = damping * -size / period * -std::expm1(-period / time_constant);
    CHECK(torque == doctest::Approx(first * std::exp(-(i - 1) * period / time_constant)));
    if (i == 1) CHECK(torque == doctest::Approx(damping / time_constant * -size).epsilon(1e-3));
  }
}

TEST_CASE("below the threshold nothing is a rate") {
  const auto torque = last_of<double>({5000, 0.5, 0.25, 1e-3}, 1e-3, 500,
                                      [](double t) { return 0.9e-3 * std::sin(40 * t); });
  CHECK(torque == 0.25);
}

TEST_CASE("a bad sample leaves the state and the torque as they were") {
  StructuralDamping<double>::State state{1e-3, 4.0, true};
  const StructuralDamping<double>::Config config{5000, 0.5, 0, 0};
  double torque = 7;
  const double none = std::numeric_limits<double>::quiet_NaN();
  CHECK(StructuralDamping<double>::step(config, state, none, 1e-3, torque) == Status::not_finite);
  CHECK(StructuralDamping<double>::step(config, state, 1e-3, 0.0, torque) == Status::bad_period);
  CHECK(StructuralDamping<double>::step(config, state, 1e-3, none, torque) == Status::bad_period);
  CHECK(StructuralDamping<double>::step(config, state, 1e-3, 1e-308, torque) == Status::ok);
  CHECK(StructuralDamping<double>::step(config, state, 1.0, 1e-320, torque) == Status::not_finite);
  CHECK(state.torsion == 1e-3);
  CHECK(state.started);
}
