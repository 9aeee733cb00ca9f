#include <doctest/doctest.h>

#include <limits>

#include "random_samples.hpp"

using namespace flexspline;

TEST_CASE_TEMPLATE("without load nothing depends on load", S, float, double) {
  std::mt19937_64 random(25);
  auto at = usual_sample<S>(random);
  at.load = 0;
  CHECK(LoadDependentFriction<S>{}.row(at)[0] == S(0));
  CHECK(GainError<S>{}.row(at)[0] == S(0));
  at.load = S(-3);
  CHECK(GainError<S>{}.row(at)[0] == S(-3));
}

TEST_CASE_TEMPLATE("constants, gravity and temperature at their edges", S, float, double) {
  Sample<S> at;
  CHECK(Offset<S>{}.row(at) == Row<S, 1>{S(1)});
  CHECK(TemperatureDrift<S>{}.row(at) == Row<S, 2>{S(0), S(0)});
  at.temperature = S(27);
  CHECK(TemperatureDrift<S>{}.row(at) == Row<S, 2>{S(2), S(4)});
  CHECK(Gravity<S>{}.row(at) == Row<S, 2>{S(0), S(1)});
  at.output_position = Angle<S>::from_turns(S(5.25));
  CHECK(Gravity<S>{}.row(at) == Row<S, 2>{S(1), S(0)});
  at.output_acceleration = S(-2);
  CHECK(Inertia<S>{}.row(at) == Row<S, 1>{S(-2)});
}

TEST_CASE_TEMPLATE("errors in proportion to load, motor and time by hand", S, float, double) {
  Sample<S> at;
  at.load = S(-3);
  CHECK(GainTemperatureDependence<S>{}.row(at) == Row<S, 1>{S(0)});
  at.temperature = S(29);
  CHECK(GainTemperatureDependence<S>{}.row(at) == Row<S, 1>{S(-12)});
  CHECK(SensorNonlinearity<S>{}.row(at) == Row<S, 2>{S(9), S(-27)});
  CHECK(TorqueConstantError<S>{}.row(at) == Row<S, 1>{S(0)});
  at.known_load = S(7);
  CHECK(TorqueConstantError<S>{}.row(at) == Row<S, 1>{S(7)});
  at.motor_torque = S(-0.25);
  CHECK(MotorCrosstalk<S>{}.row(at) == Row<S, 1>{S(-0.25)});
  CHECK(TimeDrift<S>{}.row(at) == Row<S, 2>{S(0), S(0)});
  at.time = S(10);
  CHECK(TimeDrift<S>{}.row(at) == Row<S, 2>{S(10), S(100)});
}

TEST_CASE_TEMPLATE("a sensor with hysteresis reads less on the way up than on the way down", S,
                   float, double) {
  TorqueHysteresis<S> effect;
  effect.load_width = S(8);
  typename TorqueHysteresis<S>::State state;
  const auto row = [&](S load) { return effect.row(loaded(load), state); };
  CHECK(row(S(5)) == Row<S, 4>{0, 0, 0, 0});
  CHECK(row(S(6)) == Row<S, 4>{S(-0.125), S(-0.25), S(-0.5), S(-1)});
  CHECK(row(S(30)) == Row<S, 4>{S(-1), S(-1), S(-1), S(-1)});
  CHECK(row(S(28)) == Row<S, 4>{S(-0.75), S(-0.5), S(0), S(1)});
  CHECK(effect.settled(state));
}

TEST_CASE_TEMPLATE("a lag follows a ramp by its time, whatever the period", S, float, double) {
  for (const double period : {0.001, 0.05, 3.0}) {
    SensorLag<S> effect;
    effect.smoothing_time = S(0.2);
    typename SensorLag<S>::State state;
    Sample<S> at;
    at.period = S(period);
    CHECK(effect.row(at, state)[0] == S(0));  // the first sample, whatever the load
    CHECK_FALSE(effect.settled(state));
    const int steps = static_cast<int>(4.0 / period) + 2;
    for (int i = 1; i <= steps; ++i) {
      at.load = S(5 * period * i);
      const double since = period * i;
      const double smoothed = 5 * (1 - std::exp(-since / 0.2));
      // float: a difference of loads up to 20 Nm over the period
      const double rounding = sizeof(S) == 4 ? 2.4e-6 / period : 1e-9;
      CHECK(std::abs(-double(effect.row(at, state)[0]) - smoothed) <= 1e-6 * smoothed + rounding);
    }
    CHECK(effect.settled(state));
    effect.row(at, state);
    at.load = S(1);
    typename SensorLag<S>::State fresh;
    CHECK(effect.row(at, fresh)[0] == S(0));
  }
}

TEST_CASE_TEMPLATE("a lag begins anew behind a load near the largest number", S, float, double) {
  SensorLag<S> effect;
  typename SensorLag<S>::State state;
  Sample<S> at;
  at.period = S(0.001);
  at.load = std::numeric_limits<S>::lowest();  // finite, and a sample later an infinite slope
  CHECK(effect.row(at, state)[0] == S(0));
  at.load = std::numeric_limits<S>::infinity();
  auto broken = state;
  CHECK_FALSE(math::is_finite(effect.row(at, broken)[0]));
  at.load = S(2);
  CHECK(effect.row(at, state)[0] == S(0));
  typename SensorLag<S>::State fresh;
  effect.row(at, fresh);
  at.load = S(2.5);
  CHECK(effect.row(at, state)[0] == effect.row(at, fresh)[0]);
  CHECK(effect.row(at, state)[0] < S(0));
}

TEST_CASE_TEMPLATE("heat that spreads slowly is followed in float as well as in double", S, float,
                   double) {
  ThermalGradientDrift<S> effect;
  effect.thermal_lag = S(300);
  typename ThermalGradientDrift<S>::State state;
  Sample<S> at;
  at.period = S(0.001);
  const auto row = [&](double temperature) {
    at.temperature = S(temperature);
    return double(effect.row(at, state)[0]);
  };
  CHECK(row(20.0) == 0.0);
  CHECK(effect.settled(state));  // the joint is taken to have stood in one temperature
  double behind = 0;
  constexpr int rows = 200000;  // 200 s at 1 kHz; each step of the lag is 3e-6 of what is left
  for (int i = 1; i <= rows; ++i) behind = row(20.0 + 0.05 * 0.001 * i);
  CHECK(behind == doctest::Approx(0.05 * 300 * (1 - std::exp(-200.0 / 300))).epsilon(2e-5));
  const double top = at.temperature;
  for (int i = 1; i <= rows; ++i) row(top);
  CHECK(row(top) == doctest::Approx(behind * std::exp(-200.0 / 300)).epsilon(1e-3));
}
