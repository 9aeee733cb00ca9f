#include <doctest/doctest.h>

#include <limits>

#include "random_samples.hpp"

using namespace flexspline;

TEST_CASE_TEMPLATE("the mesh yields in proportion first and stiffens, against the torque", S, float,
                   double) {
  const MeshCompliance<S> effect{S(0.05)};
  const auto row = [&](S load) {
    Sample<S> at;
    at.load = load;
    return effect.row(at)[0];
  };
  CHECK(row(0) == S(0));
  CHECK(row(S(0.01)) == doctest::Approx(-0.01).epsilon(1e-6));
  CHECK(row(S(20)) == doctest::Approx(-std::atan(1.0) / 0.05).epsilon(1e-6));
  CHECK(row(S(1e30)) == doctest::Approx(-1.5707963267948966 / 0.05).epsilon(1e-6));
  CHECK(row(S(-20)) == -row(S(20)));
}

TEST_CASE_TEMPLATE("the wave generator yields to its stop, against the motor's torque", S, float,
                   double) {
  const WaveGeneratorCompliance<S> effect{S(3)};
  const auto row = [&](S torque) {
    Sample<S> at;
    at.motor_torque = torque;
    return effect.row(at)[0];
  };
  CHECK(row(0) == S(0));
  CHECK(row(S(1e-4)) == doctest::Approx(-1e-4).epsilon(2e-4));
  CHECK(row(S(0.4)) == doctest::Approx(std::expm1(-1.2) / 3).epsilon(1e-6));
  CHECK(row(S(1e30)) == S(-1) / S(3));
  CHECK(row(S(-0.4)) == -row(S(0.4)));
}

TEST_CASE_TEMPLATE("springs that slip follow the path and forget nothing but their overrun", S,
                   float, double) {
  TorsionalHysteresis<S> effect;
  effect.load_width = S(8);
  typename TorsionalHysteresis<S>::State state;
  const auto row = [&](S load) {
    Sample<S> at;
    at.load = load;
    return effect.row(at, state);
  };
  CHECK(row(S(5)) == Row<S, 4>{0, 0, 0, 0});  // the first sample is the start, wherever it is
  CHECK(row(S(6)) == Row<S, 4>{S(0.125), S(0.25), S(0.5), S(1)});
  CHECK(row(S(9)) == Row<S, 4>{S(0.5), S(1), S(1), S(1)});
  CHECK(row(S(7)) == Row<S, 4>{S(0.25), S(0.5), S(0), S(-1)});
  CHECK_FALSE(effect.settled(state));
  CHECK(row(S(20)) == Row<S, 4>{S(1), S(1), S(1), S(1)});
  CHECK_FALSE(effect.settled(state));  // 5 to 20 is less than twice the width
  CHECK(row(S(21)) == Row<S, 4>{S(1), S(1), S(1), S(1)});
  CHECK(effect.settled(state));
  const auto saved = state;
  const auto next = row(S(17));
  state = saved;
  CHECK(row(S(17)) == next);
}

TEST_CASE_TEMPLATE("on the motor's path the way counts over whole turns, the other way round", S,
                   float, double) {
  TorsionalHysteresis<S> effect;
  effect.path = S(1);
  effect.angle_width = S(16);
  typename TorsionalHysteresis<S>::State state;
  S last = 0;
  for (int i = 0; i <= 40; ++i) {  // five turns in steps of an eighth
    Sample<S> at;
    at.motor_position = Angle<S>::from_turns(S(i) / S(8));
    at.motor_position.turns = 0;  // the phase alone counts, as in a batch
    last = effect.row(at, state)[0];
    CHECK(last == doctest::Approx(-std::min(i / 8.0 * 6.283185307179586 / 16, 1.0)).epsilon(1e-5));
  }
  CHECK(last == S(-1));
}

TEST_CASE_TEMPLATE("a loop of hysteresis costs energy on either path", S, float, double) {
  TorsionalHysteresis<S> effect;
  for (const S path : {S(0), S(1)}) {
    effect.path = path;
    typename TorsionalHysteresis<S>::State state;
    std::array<S, 4> work{};
    for (int i = 0; i <= 400; ++i) {
      Sample<S> at;
      const double swing = 0.4 * std::sin(2 * 3.141592653589793 * i / 200);
      at.load = S(60 * swing);
      at.motor_position = Angle<S>::from_turns(S(swing));
      // by the load: ∮ Δθ dτ < 0 lags; by the motor: −∮ Δθ dθ > 0 is what friction takes
      const S driven =
          path == S(0) ? at.load - state.load : (at.motor_position.phase - state.motor).shortest();
      const auto row = effect.row(at, state);
      for (std::size_t k = 0; k < 4 && i > 200; ++k) work[k] += row[k] * driven;
    }
    for (const S w : work) CHECK((path == S(0) ? w : -w) > S(0));
  }
}

TEST_CASE_TEMPLATE("backlash has one end for each direction of torque, against it", S, float,
                   double) {
  const Backlash<S> effect{S(0.5)};
  const auto row = [&](S load) {
    Sample<S> at;
    at.load = load;
    return effect.row(at)[0];
  };
  CHECK(row(0) == S(0));
  CHECK(row(S(0.005)) == doctest::Approx(-0.01).epsilon(1e-4));
  CHECK(row(S(20)) == S(-1));
  CHECK(row(std::numeric_limits<S>::max()) == S(-1));
  CHECK(row(S(-0.3)) == -row(S(0.3)));
}

TEST_CASE_TEMPLATE("a warm mesh gives way by its share more for each kelvin", S, float, double) {
  Sample<S> at;
  at.load = S(20);
  CHECK(TemperatureDependentStiffness<S>{}.row(at)[0] == S(0));
  at.temperature = S(35);
  const S cold = MeshCompliance<S>{}.row(at)[0];
  CHECK(TemperatureDependentStiffness<S>{}.row(at)[0] == cold * S(10));
  at.load = S(0);
  CHECK(TemperatureDependentStiffness<S>{}.row(at)[0] == S(0));
}
