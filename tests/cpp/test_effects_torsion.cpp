#include <doctest/doctest.h>

#include <limits>

#include "random_samples.hpp"

using namespace flexspline;

TEST_CASE_TEMPLATE("the mesh yields in proportion first and stiffens, against the torque", S, float,
                   double) {
  const MeshCompliance<S> effect{S(0.05)};
  const auto row = [&](S load) { return effect.row(loaded(load))[0]; };
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
  const auto row = [&](S load) { return effect.row(loaded(load), state); };
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
  const auto row = [&](S load) { return effect.row(loaded(load))[0]; };
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

namespace {

/// The row after so many rounds of 1000 samples, none of which lets the widest spring slip.
template <typename S, typename Effect>
Row<S, 4> after_rounds(const Effect& effect, int rounds) {
  typename Effect::State state;
  Row<S, 4> row{};
  for (int i = 0; i <= 1000 * rounds; ++i) {
    const double turn = 6.283185307179586 * (i % 1000) / 1000.0;
    const double part = std::sin(turn) + 0.3 * std::sin(2 * turn + 1) + 0.2 * std::cos(5 * turn);
    Sample<S> at;
    at.load = S(0.3 + 4.1 * part);
    at.output_position = at.motor_position = Angle<S>::from_radians(S(0.71 + 0.041 * part));
    row = effect.row(at, state);
  }
  return row;
}

}  // namespace

TEST_CASE_TEMPLATE("springs that never slip are where they were, after any number of rounds", S,
                   float, double) {
  TorqueHysteresis<S> sensor;
  sensor.load_width = S(10.7);
  PreslidingFriction<S> friction;
  friction.presliding_width = S(0.107);
  TorsionalHysteresis<S> gear;
  gear.path = S(1);
  gear.angle_width = S(0.107);
  // The narrower ones slip in the first round.
  CHECK(after_rounds<S>(sensor, 1000) == after_rounds<S>(sensor, 2));
  CHECK(after_rounds<S>(friction, 1000) == after_rounds<S>(friction, 2));
  CHECK(after_rounds<S>(gear, 1000) == after_rounds<S>(gear, 2));
  CHECK(math::absolute(after_rounds<S>(sensor, 1000)[0]) < S(1));
}

TEST_CASE_TEMPLATE("places on the grid are as near as a width's last binary places", S, float,
                   double) {
  using Springs = MaxwellSlip<S, 4>;
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 20000; ++i) {
    const S width = S(std::exp2(8 * unit(random) - 4));
    const S grain = std::numeric_limits<S>::epsilon() * width;
    const S place = S(unit(random)) * width;
    CHECK(math::absolute(Springs::on_grid(place, width) - place) <= S(2.01L) * grain);
    const Phase<S> angle{static_cast<math::Bits<S>>(random())};
    const S moved = (Springs::on_grid(angle, width) - angle).shortest();
    CHECK(math::absolute(moved) <= S(1.01L) * grain);
  }
  const Phase<S> angle{static_cast<math::Bits<S>>(random())};
  for (const S width :
       {S(0), S(1e30L), std::numeric_limits<S>::infinity(), std::numeric_limits<S>::quiet_NaN()}) {
    (void)Springs::on_grid(angle, width);  // no shift beyond the bits: the sanitizers would tell
  }
}
