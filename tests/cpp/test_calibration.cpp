#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "flexspline/estimators/calibration.hpp"

using namespace flexspline;

TEST_CASE_TEMPLATE("a voltage becomes torque by the published line", S, float, double) {
  // zhang_disturbance_elimination (25)
  const Calibration<S> made{S(62.738), S(2.1835), S(-0.1), S(1.1)};
  FlaggedTorque<S> out;
  REQUIRE(made.torque(S(0), S(0), out) == Status::ok);
  CHECK(out.torque == S(2.1835));
  REQUIRE(made.torque(S(-0.0348), S(0), out) == Status::ok);
  CHECK(std::abs(static_cast<double>(out.torque)) <= 62.738 * 0.00005);  // −34.8 mV: its zero
  REQUIRE(made.torque(S(1), S(-0.25), out) == Status::ok);
  CHECK(static_cast<double>(out.torque) == doctest::Approx(64.6715).epsilon(rounding<S>(4)));
  CHECK(out.flags == Flag::none);
}

TEST_CASE_TEMPLATE("a voltage outside the calibration is flagged", S, float, double) {
  const Calibration<S> made{S(62.738), S(2.1835), S(-0.1), S(1.1)};
  FlaggedTorque<S> out;
  for (const S voltage : {S(-0.11), S(1.2)}) {
    REQUIRE(made.torque(voltage, S(0), out) == Status::ok);
    CHECK(out.flags == Flag::extrapolated);
  }
}

TEST_CASE_TEMPLATE("a voltage or a drift that is not finite leaves the torque alone", S, float,
                   double) {
  const Calibration<S> made{S(62.738), S(2.1835)};
  FlaggedTorque<S> out{S(7), Flag::saturated};
  for (const S bad : not_finite<S>) {
    CHECK(made.torque(bad, S(0), out) == Status::not_finite);
    CHECK(made.torque(S(0), bad, out) == Status::not_finite);
  }
  CHECK(made.torque(std::numeric_limits<S>::max(), S(0), out) == Status::not_finite);
  CHECK(out.torque == S(7));
  CHECK(out.flags == Flag::saturated);
}
