#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "flexspline/estimators/thermistor.hpp"

using namespace flexspline;

namespace {

template <typename S>
constexpr Thermistor<S> made{S(3.3), S(10000), S(10000), S(3435), S(25)};

template <typename S>
S temperature_of(S voltage, Status expected = Status::ok) {
  S found = S(-1000);
  CHECK(made<S>.temperature(voltage, found) == expected);
  return found;
}

}  // namespace

TEST_CASE_TEMPLATE("a thermistor as large as the divider reads the nominal temperature", S, float,
                   double) {
  CHECK(temperature_of(S(1.65)) == doctest::Approx(25).epsilon(rounding<S>(4)));
}

TEST_CASE_TEMPLATE("a temperature agrees with the formula as printed", S, float, double) {
  for (double voltage = 0.05; voltage < 3.28; voltage += 0.01) {
    const double resistance = voltage * 10000 / (3.3 - voltage);
    const double nominal = 298.15;
    const double kelvin =
        3435 * nominal / (nominal * (std::log(resistance) - std::log(10000.0)) + 3435);
    // the divider's ratio has no digits to spare where little voltage is left over
    const double bound = rounding<S>(8) * kelvin * 3.3 / (3.3 - voltage);
    CHECK(std::abs(static_cast<double>(temperature_of(S(voltage))) - (kelvin - 273.15)) <= bound);
  }
}

TEST_CASE_TEMPLATE("temperature to voltage and back is the same temperature", S, float, double) {
  for (S temperature = -40; temperature <= S(120); temperature += S(0.5)) {
    S voltage = 0;
    REQUIRE(made<S>.voltage(temperature, voltage) == Status::ok);
    // dT = dV / |dV/dT|, dV/dT = −V (V_cc − V) / V_cc · B / T²
    const double v = static_cast<double>(voltage), t = static_cast<double>(temperature) + 273.15;
    const double slope = v * (3.3 - v) / 3.3 * 3435 / (t * t);
    const double bound = rounding<S>(12) * (v / slope + t);
    CHECK(std::abs(static_cast<double>(temperature_of(voltage) - temperature)) <= bound);
  }
}

TEST_CASE_TEMPLATE("warmer is less voltage", S, float, double) {
  S last = std::numeric_limits<S>::max();
  for (S temperature = -50; temperature <= S(150); temperature += S(1)) {
    S voltage = 0;
    REQUIRE(made<S>.voltage(temperature, voltage) == Status::ok);
    CHECK(voltage < last);
    last = voltage;
  }
}

TEST_CASE_TEMPLATE("an open or short line is refused", S, float, double) {
  for (const S voltage : {S(0), S(-0.1), S(3.3), S(5)}) {
    CHECK(temperature_of(voltage, Status::out_of_range) == S(-1000));
  }
  for (const S voltage : not_finite<S>) {
    CHECK(temperature_of(voltage, Status::not_finite) == S(-1000));
  }
  // T_n L + B < 0: the formula has passed infinity
  CHECK(temperature_of(S(1e-6), Status::out_of_range) == S(-1000));
  S voltage = S(7);
  CHECK(made<S>.voltage(S(-273.15L), voltage) == Status::out_of_range);
  CHECK(made<S>.voltage(not_a_number<S>, voltage) == Status::not_finite);
  CHECK(voltage == S(7));
}
