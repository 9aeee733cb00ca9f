#include <doctest/doctest.h>

#include <vector>

#include "flexspline/block.hpp"
#include "flexspline/effects/coulomb_friction.hpp"
#include "flexspline/effects/gain_error.hpp"
#include "flexspline/effects/inertia.hpp"
#include "flexspline/effects/load_dependent_friction.hpp"
#include "flexspline/effects/offset.hpp"
#include "flexspline/effects/sensor_nonlinearity.hpp"
#include "flexspline/effects/temperature_drift.hpp"
#include "flexspline/effects/viscous_friction.hpp"
#include "flexspline/joint.hpp"

using namespace flexspline;

namespace {

constexpr double ratio = 101.0;

template <typename S>
double twist(std::int32_t turns, double fraction, double theta_turns, double rest) {
  const auto gear = Gear<S>::from_ratio(ratio, OutputSpline::circular, true);
  const Angle<S> q{turns, Angle<S>::from_turns(S(fraction)).phase};
  const Phase<S> theta = Angle<S>::from_turns(S(theta_turns)).phase;
  return static_cast<double>(mesh_torsion_left(gear, S(ratio), q, theta, S(rest)));
}

/// A sensor with a zero and a gain error: τ_s = 0.5 + 1.1 τ.
template <typename S>
using Sensor = Model<S, Offset<S>, GainError<S>>;
template <typename S>
using Plain = Joint<S, Sensor<S>, Model<S>, Model<S>, Model<S>>;

template <typename S>
Plain<S> plain() {
  Plain<S> joint{};
  joint.sensing.sensor = true;
  joint.estimating.sensor = true;
  std::get<0>(joint.sensor.parts).coefficients = {S(0.5)};
  std::get<1>(joint.sensor.parts).coefficients = {S(0.1)};
  return joint;
}

template <typename S>
Reading<S> reading(double torque) {
  Reading<S> in;
  in.period = S(0.001);
  in.sensor_torque = S(torque);
  return in;
}

}  // namespace

TEST_CASE_TEMPLATE("the mesh's torsion is the same after a million turns", S, float, double) {
  // A quarter turn of q is 25.25 of the motor; the motor runs 0.01 turns ahead.
  const double near = twist<S>(0, 0.25, 0.26, 0.0);
  CHECK(near == twist<S>(1'000'000, 0.25, 0.26, 0.0));
  CHECK(near == twist<S>(-1'000'000, 0.25, 0.26, 0.0));
  const double exact = -0.01 * 2.0 * 3.141592653589793 / ratio;
  CHECK(near == doctest::Approx(exact).epsilon(sizeof(S) == 4 ? 1e-6 : 1e-14));
}

TEST_CASE_TEMPLATE("whole turns between the encoders' zeros do not count", S, float, double) {
  const double turn = 2.0 * 3.141592653589793;
  const double none = twist<S>(3, 0.5, 0.49, 0.02);
  for (const double turns : {-7.0, 1.0, 12.0}) {
    // The rest is rounded once: half a unit in the last place of 12 turns.
    const double unit = sizeof(S) == 4 ? 0x1p-24 : 0x1p-52;
    CHECK(math::absolute(twist<S>(3, 0.5, 0.49, 0.02 + turns * turn) - none) <=
          80.0 * unit / ratio * 2);
  }
}

TEST_CASE_TEMPLATE("a gain error of any size is taken off", S, float, double) {
  auto joint = plain<S>();
  typename Plain<S>::Chain::Output out;
  for (const double gain : {-0.5, -0.2, 0.1, 0.25, 1.0}) {
    typename Plain<S>::State state;
    std::get<1>(joint.sensor.parts).coefficients = {S(gain)};
    for (const double load : {-20.0, 0.0, 3.0, 70.0}) {
      REQUIRE(joint.step(state, reading<S>(0.5 + (1.0 + gain) * load), out) == Status::ok);
      CHECK(out.missed == Stage::none);
      CHECK(static_cast<double>(out.external_sensor) ==
            doctest::Approx(load).epsilon(sizeof(S) == 4 ? 1e-5 : 1e-12).scale(1.0));
    }
  }
}

TEST_CASE_TEMPLATE("a bend of a fifth of the load is taken off to two thousandths", S, float,
                   double) {
  using Bent = Joint<S, Model<S, SensorNonlinearity<S>>, Model<S>, Model<S>, Model<S>>;
  Bent joint{};
  joint.sensing.sensor = true;
  joint.estimating.sensor = true;
  std::get<0>(joint.sensor.parts).coefficients = {S(0.002), S(0)};
  typename Bent::State state;
  typename Bent::Chain::Output out;
  for (const double load : {-100.0, -10.0, 1.0, 50.0, 100.0}) {
    REQUIRE(joint.step(state, reading<S>(load + 0.002 * load * load), out) == Status::ok);
    CHECK(static_cast<double>(out.external_sensor) == doctest::Approx(load).epsilon(2e-3));
  }
}

TEST_CASE_TEMPLATE("a reading that is missing leaves the last good value and says so", S, float,
                   double) {
  const auto joint = plain<S>();
  typename Plain<S>::State state;
  typename Plain<S>::Chain::Output out;
  REQUIRE(joint.step(state, reading<S>(5.0), out) == Status::ok);
  const S last = out.external_sensor;
  REQUIRE(joint.step(state, reading<S>(std::numeric_limits<double>::quiet_NaN()), out) ==
          Status::ok);
  CHECK(has(out.missed, Stage::sensor));
  CHECK(out.external_sensor == last);
}

TEST_CASE_TEMPLATE("a bad period changes neither state nor estimate", S, float, double) {
  auto joint = plain<S>();
  joint.estimating.observer = typename Plain<S>::Chain::Observer::Config{};
  typename Plain<S>::State state;
  typename Plain<S>::State other;
  typename Plain<S>::Chain::Output out;
  typename Plain<S>::Chain::Output same;
  for (int k = 0; k < 50; ++k) {
    const Reading<S> in = reading<S>(2.0 + k);
    REQUIRE(joint.step(state, in, out) == Status::ok);
    REQUIRE(joint.step(other, in, same) == Status::ok);
    for (const double period : {0.0, -1.0, std::numeric_limits<double>::infinity()}) {
      Reading<S> bad = in;
      bad.period = S(period);
      CHECK(joint.step(other, bad, same) == Status::bad_period);
    }
    CHECK(out.external_observer == same.external_observer);
    CHECK(out.external_sensor == same.external_sensor);
  }
}

TEST_CASE_TEMPLATE("models go on with the last good temperature and start with none", S, float,
                   double) {
  Joint<S, Model<S, TemperatureDrift<S>>, Model<S>, Model<S>, Model<S>> joint{};
  joint.sensing.sensor = joint.estimating.sensor = true;
  joint.low = S(20);
  joint.high = S(40);
  std::get<0>(joint.sensor.parts).coefficients = {S(0.125), S(0)};
  typename decltype(joint)::State state;
  typename decltype(joint)::Chain::Output out;
  REQUIRE(joint.step(state, reading<S>(3.0), out) == Status::ok);
  CHECK(has(out.missed, Stage::sensor));
  Reading<S> warm = reading<S>(3.0);
  warm.temperature = S(33);
  REQUIRE(joint.step(state, warm, out) == Status::ok);
  CHECK(out.external_sensor == S(2));
  REQUIRE(joint.step(state, reading<S>(4.0), out) == Status::ok);
  CHECK(out.external_sensor == S(3));
  CHECK_FALSE(has(out.flags, Flag::extrapolated));
  warm.temperature = S(41);
  REQUIRE(joint.step(state, warm, out) == Status::ok);
  CHECK(has(out.flags, Flag::extrapolated));
}

TEST_CASE_TEMPLATE("a part that reads an angle is silent without it, the others are not", S, float,
                   double) {
  Joint<S, Sensor<S>, Model<S>, Model<S>, Model<S>> joint = plain<S>();
  joint.estimating.compliance = Compliance<S>{};
  typename decltype(joint)::State state;
  typename decltype(joint)::Chain::Output out;
  Reading<S> in = reading<S>(3.0);
  REQUIRE(joint.step(state, in, out) == Status::ok);
  CHECK(has(out.missed, Stage::compliance));
  CHECK_FALSE(has(out.missed, Stage::sensor));
  in.output_position = Angle<S>{};
  in.motor_position = Angle<S>{};
  REQUIRE(joint.step(state, in, out) == Status::ok);
  CHECK(out.missed == Stage::none);
  CHECK(out.external_compliance == S(0));
}

namespace {

/// A joint without sensor whose friction is a tenth of its load, at full speed.
template <typename S>
using Blind = Joint<S, Model<S>, Model<S, LoadDependentFriction<S>>, Model<S>, Model<S>>;

template <typename S>
Blind<S> blind() {
  Blind<S> joint{};
  joint.estimating.observer = {S(100), Discretisation::exact};
  joint.estimating.observer_input = ObserverInput::motor_torque;
  joint.estimating.compliance = Compliance<S>{S(10000), S(0.05L)};
  joint.effective_ratio = S(ratio);
  joint.torsion.gear = Gear<S>::from_ratio(ratio, OutputSpline::circular, true);
  std::get<0>(joint.observed.parts).coefficients = {S(0.1)};
  return joint;
}

/// The gear carries `load`; NaN: its torsion is not read.
template <typename S>
Reading<S> carrying(double load) {
  Reading<S> in;
  in.period = S(0.001);
  in.motor_torque = S(0);
  in.output_velocity = S(3);
  in.output_position = Angle<S>{};
  const double torsion = mesh_torsion(load, 10000.0, 0.05);
  if (math::is_finite(load)) in.motor_position = Angle<S>::from_radians(S(-torsion * ratio));
  return in;
}

}  // namespace

TEST_CASE_TEMPLATE("without a sensor the load is that of the sample before, and zero at first", S,
                   float, double) {
  const auto joint = blind<S>();
  typename Blind<S>::State state;
  typename Blind<S>::Chain::Output out;
  typename Blind<S>::Chain::Observer::State expected;
  constexpr double gone = std::numeric_limits<double>::quiet_NaN();
  const std::array<double, 8> loads{gone, 4.0, -7.0, gone, 2.0, 1e4, 1e4, 5.0};
  const std::array<double, 8> known{0.0, 0.0, 4.0, -7.0, -7.0, 2.0, 2.0, 2.0};
  for (std::size_t k = 0; k < loads.size(); ++k) {
    REQUIRE(joint.step(state, carrying<S>(loads[k]), out) == Status::ok);
    CHECK(has(out.missed, Stage::compliance) == !math::is_finite(loads[k]));
    CHECK(has(out.flags, Flag::saturated) == (loads[k] > 100));
    CHECK_FALSE(has(out.missed, Stage::observer));
    S external = 0;
    const S friction = S(0.1L) * S(math::absolute(known[k]));
    REQUIRE(Blind<S>::Chain::Observer::step(*joint.estimating.observer, expected, S(0), -friction,
                                            S(0.001), external) == Status::ok);
    CHECK(static_cast<double>(math::absolute(out.external_observer - external)) <= 2e-4);
  }
  state = {};
  REQUIRE(joint.step(state, carrying<S>(4.0), out) == Status::ok);
  REQUIRE(joint.step(state, carrying<S>(4.0), out) == Status::ok);
  CHECK(out.external_observer < S(0));
  state = {};
  CHECK(state.gear_load == S(0));
}

TEST_CASE_TEMPLATE("a state is saved, restored and reset, and two joints share the code alone", S,
                   float, double) {
  const auto joint = blind<S>();
  using State = typename Blind<S>::State;
  using Output = typename Blind<S>::Chain::Output;
  const auto run = [&](State& state, Output& out, int from, int to) {
    for (int k = from; k < to; ++k) {
      REQUIRE(joint.step(state, carrying<S>(4.0 * ((k * 37) % 11) - 20.0), out) == Status::ok);
    }
  };
  State whole, first, other;
  Output expected, out, beside;
  run(whole, expected, 0, 60);
  run(first, out, 0, 30);
  run(other, beside, 7, 50);  // a second joint, in between
  const State saved = first;
  run(first, out, 30, 60);
  CHECK(out.external_observer == expected.external_observer);
  Output again;
  State restored = saved;
  run(restored, again, 30, 60);
  CHECK(again.external_observer == expected.external_observer);
  CHECK(again.external_compliance == expected.external_compliance);
  restored = {};
  run(restored, again, 0, 60);
  CHECK(again.external_observer == expected.external_observer);
  CHECK(beside.external_observer != expected.external_observer);
}

namespace {

template <typename S>
using Drive = Model<S, CoulombFriction<S>, ViscousFriction<S>, Offset<S>>;
template <typename S>
using Learner = Joint<S, Sensor<S>, Drive<S>, Model<S>, Model<S>>;

/// Friction of 5 Nm and 8 Nm s/rad, an offset of 0.2 Nm that is not adapted.
template <typename S>
Learner<S> learner(AdaptationUse use) {
  Learner<S> joint{};
  auto& [coulomb, viscous, offset] = joint.observed.parts;
  coulomb.coefficients = {S(5)};
  viscous.coefficients = {S(8)};
  offset.coefficients = {S(0.2)};
  joint.effective_ratio = S(101);
  joint.inertia = S(0.4);
  joint.estimating.observer.emplace();
  joint.estimating.observer_input = ObserverInput::motor_torque;
  auto& collision = joint.estimating.collision.emplace();
  collision.negative.fill(S(3));
  collision.positive.fill(S(3));
  auto& made = joint.estimating.adaptation.emplace();
  made.noise = S(0.5);
  made.memory = S(20);
  made.least_speed = S(0.05);
  made.low = {S(2), S(3), S(0.2)};
  made.high = {S(10), S(20), S(0.2)};
  made.factor[0] = S(0.1);
  made.factor[2] = S(0.3);
  made.use = use;
  return joint;
}

/// Sample k of a swing with friction of 6 Nm and 9 Nm s/rad, pushed by `push` Nm from outside.
template <typename S>
Reading<S> swing(int k, double push = 0.0) {
  const double t = 0.002 * k;
  const double v = 0.6 * std::sin(1.3 * t) + 0.3 * std::sin(0.4 * t);
  const double a = 0.78 * std::cos(1.3 * t) + 0.12 * std::cos(0.4 * t);
  const double coulomb = std::tanh(v / double(CoulombFriction<double>{}.direction_width));
  Reading<S> in;
  in.period = S(0.002);
  in.output_velocity = S(v);
  in.motor_torque = S((0.4 * a + 6 * coulomb + 9 * v + 0.2 + push) / 101);
  return in;
}

/// Runs samples [first, last); how far the observer was off at most in the last 2000.
template <typename S>
double run(const Learner<S>& joint, typename Learner<S>::State& state, int first, int last,
           double push = 0.0) {
  typename Learner<S>::Chain::Output out;
  double worst = 0;
  for (int k = first; k < last; ++k) {
    REQUIRE(joint.step(state, swing<S>(k, push), out) == Status::ok);
    const double off = math::absolute(static_cast<double>(out.external_observer) - push);
    if (k >= last - 2000) worst = std::max(worst, off);
  }
  return worst;
}

}  // namespace

TEST_CASE_TEMPLATE("a joint learns its friction, and its observer goes by it where it is to", S,
                   float, double) {
  for (const auto use : {AdaptationUse::monitor, AdaptationUse::compensate}) {
    const auto joint = learner<S>(use);
    typename Learner<S>::State state;
    const double off = run(joint, state, 0, 50'000);
    const auto learned = joint.adapted(state);
    CHECK(double(learned[0]) == doctest::Approx(6).epsilon(0.01));
    CHECK(double(learned[1]) == doctest::Approx(9).epsilon(0.01));
    CHECK(learned[2] == S(0.2));
    if (use == AdaptationUse::monitor) CHECK(off > 1.0);
    if (use == AdaptationUse::compensate) CHECK(off < 0.15);
  }
}

TEST_CASE_TEMPLATE("a push that is a contact teaches nothing", S, float, double) {
  const auto joint = learner<S>(AdaptationUse::compensate);
  typename Learner<S>::State state;
  (void)run(joint, state, 0, 50'000);
  const auto learned = joint.adapted(state);
  CHECK(run(joint, state, 50'000, 60'000, 8.0) < 0.2);
  const auto after = joint.adapted(state);
  for (std::size_t k = 0; k < 2; ++k) {
    CHECK(double(after[k]) == doctest::Approx(double(learned[k])).epsilon(0.01));
  }
}

TEST_CASE_TEMPLATE("what was learned is kept behind a gap, and by a block that is saved", S, float,
                   double) {
  auto joint = learner<S>(AdaptationUse::compensate);
  typename Learner<S>::State state;
  (void)run(joint, state, 0, 20'000);
  const auto learned = joint.adapted(state);
  Learner<S>::restart(state);
  CHECK(joint.adapted(state) == learned);
  CHECK_FALSE(state.chain.observer.started);
  auto adopted = joint;
  adopted.adopt(state);
  std::vector<std::uint8_t> bytes(block_size(adopted));
  std::size_t size = 0;
  REQUIRE(save(adopted, bytes, size) == BlockStatus::ok);
  typename Learner<S>::State next;  // after the power was off
  auto started = learner<S>(AdaptationUse::compensate);
  REQUIRE(load(bytes, started) == BlockStatus::ok);
  CHECK(started.adapted(next) == learned);
  CHECK(run(started, next, 20'000, 30'000) < 0.2);
  CHECK(next.adaptation.taught > 100);
  REQUIRE(load(bytes, joint) == BlockStatus::ok);  // while it runs: from there on
  CHECK(joint.adapted(state) == learned);
  (void)run(joint, state, 20'000, 20'010);
  CHECK(state.adaptation.taught == 0);
  CHECK(joint.adapted(state) == learned);
}
