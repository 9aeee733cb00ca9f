#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "flexspline/estimators/chain.hpp"

using namespace flexspline;

namespace {

/// A joint that swings, as its channels.
template <typename S>
typename Chain<S>::Input sample(int i) {
  const double t = 0.001 * i;
  typename Chain<S>::Input in;
  in.period = S(0.001);
  in.voltage = S(0.3 * std::sin(3 * t));
  in.thermistor_voltage = S(1.4 - 0.01 * t);
  in.sensor_intrinsic = S(0.2 * std::cos(20 * t));
  in.motor_torque = S(20 * std::sin(3 * t));
  in.momentum = S(1.9 * std::cos(2 * t));
  in.observer_intrinsic = S(0.5);
  in.torsion = S(-1e-3 * std::sin(3 * t));
  in.gear_known = S(0.3);
  in.link_momentum = S(1.1 * std::cos(2 * t));
  in.velocity = S(0.01 * std::sin(t));
  return in;
}

/// The numbers of an output, for comparison in bits.
template <typename S>
bool same(const typename Chain<S>::Output& a, const typename Chain<S>::Output& b) {
  return same_bits(a.temperature, b.temperature) && same_bits(a.sensor_torque, b.sensor_torque) &&
         same_bits(a.external_sensor, b.external_sensor) &&
         same_bits(a.external_observer, b.external_observer) &&
         same_bits(a.external_compliance, b.external_compliance) &&
         same_bits(a.external_compliant_observer, b.external_compliant_observer) &&
         same_bits(a.external_merged, b.external_merged) &&
         same_bits(a.merge_weight, b.merge_weight) && a.contact == b.contact;
}

template <typename S>
struct Device {
  typename Chain<S>::Config config = whole_chain<S>();
  typename Chain<S>::State state{};
  typename Chain<S>::Output out{};

  void run(int from, int to) {
    for (int i = from; i < to; ++i) step(sample<S>(i));
  }
  void step(const typename Chain<S>::Input& in) {
    REQUIRE(Chain<S>::step(config, state, in, out) == Status::ok);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("the chain gives what its stages give one by one", S, float, double) {
  Device<S> device;
  const auto config = whole_chain<S>();
  typename TemperatureCompensation<S>::State body;
  typename MomentumObserver<S>::State observer, link;
  typename LoadHysteresis<S>::State springs;
  typename CollisionDetector<S>::State detector;
  for (int i = 0; i < 500; ++i) {
    const auto in = sample<S>(i);
    device.step(in);
    S temperature = 0, external = 0, weight = 0, merged = 0, left = 0, behind = 0;
    FlaggedTorque<S> drift, sensor, gear;
    bool contact = false;
    CHECK(config.thermistor->temperature(in.thermistor_voltage, temperature) == Status::ok);
    CHECK(TemperatureCompensation<S>::step(*config.compensation, body, temperature, in.period,
                                           drift) == Status::ok);
    CHECK(config.calibration->torque(in.voltage, drift.torque, sensor) == Status::ok);
    CHECK(MomentumObserver<S>::step(*config.observer, observer, in.momentum,
                                    sensor.torque - in.observer_intrinsic, in.period,
                                    external) == Status::ok);
    CHECK(config.hysteresis->torque(*config.compliance, springs, in.torsion, left, gear) ==
          Status::ok);
    CHECK(MomentumObserver<S>::step(*config.compliant_observer, link, in.link_momentum,
                                    gear.torque - in.gear_known, in.period, behind) == Status::ok);
    CHECK(config.logistic->merge(in.velocity, external, gear.torque - in.gear_known, weight,
                                 merged) == Status::ok);
    CHECK(CollisionDetector<S>::step(*config.collision, detector, merged, in.velocity, in.period,
                                     contact) == Status::ok);
    const typename Chain<S>::Output expected{temperature,
                                             sensor.torque,
                                             sensor.torque - in.sensor_intrinsic,
                                             external,
                                             gear.torque - in.gear_known,
                                             behind,
                                             merged,
                                             weight,
                                             contact};
    CHECK(same<S>(device.out, expected));
    CHECK(device.out.missed == Stage::none);
    CHECK(device.out.flags == Flag::none);
  }
}

TEST_CASE_TEMPLATE("the chain in two parts equals the chain in one", S, float, double) {
  Device<S> one, two;
  one.config.kalman = two.config.kalman = typename KalmanMerge<S>::Config{};
  one.run(0, 700);
  two.run(0, 300);
  Device<S> later{two.config, two.state, two.out};
  later.run(300, 700);
  CHECK(same<S>(one.out, later.out));
}

TEST_CASE_TEMPLATE("a missing channel stops its stage and what follows, and no other", S, float,
                   double) {
  using Input = typename Chain<S>::Input;
  struct Case {
    S Input::* channel;
    Stage missed;
  };
  const Stage end = Stage::merge | Stage::collision;
  const Stage gear = Stage::compliance | Stage::compliant_observer | end;
  const std::array<Case, 10> cases{{
      {&Input::voltage, Stage::sensor | Stage::observer | end},
      {&Input::thermistor_voltage, Stage::thermistor | Stage::compensation},
      {&Input::sensor_intrinsic, Stage::sensor | Stage::observer | end},
      {&Input::motor_torque, Stage::none},
      {&Input::momentum, Stage::observer | end},
      {&Input::observer_intrinsic, Stage::observer | end},
      {&Input::torsion, gear},
      {&Input::gear_known, gear},
      {&Input::link_momentum, Stage::compliant_observer},
      {&Input::velocity, end},
  }};
  for (const Case& one : cases) {
    for (const S bad : not_finite<S>) {
      Device<S> device;
      device.run(0, 50);
      const auto before = device.out;
      Input in = sample<S>(50);
      in.*one.channel = bad;
      device.step(in);
      CHECK(device.out.missed == one.missed);
      CHECK((device.out.external_merged == before.external_merged) ==
            has(one.missed, Stage::merge));
      CHECK((device.out.external_sensor == before.external_sensor) ==
            has(one.missed, Stage::sensor));
      device.run(51, 60);
      CHECK(device.out.missed == Stage::none);
      CHECK(math::is_finite(device.out.external_merged));
    }
  }
}

TEST_CASE("after a gap the observer counts the whole time since its last good sample") {
  Device<double> all, some;
  all.config.observer_input = some.config.observer_input = ObserverInput::motor_torque;
  for (int i = 0; i < 100; ++i) {
    auto in = sample<double>(i);
    in.motor_torque = 0;
    in.momentum = -4e-3 * i;  // 4 Nm from outside
    all.step(in);
    if (i % 5 == 2) in.momentum = not_a_number<double>;
    some.step(in);
  }
  CHECK(some.out.external_observer == doctest::Approx(all.out.external_observer).epsilon(1e-12));
}

TEST_CASE("an Euler observer goes on after a gap that is too long for it") {
  Device<double> device;
  device.config.observer = {1500, Discretisation::euler};
  device.run(0, 50);
  const double before = device.out.external_observer;
  auto in = sample<double>(50);
  in.period = 0.5;
  device.step(in);
  CHECK(has(device.out.missed, Stage::observer));
  CHECK(device.out.external_observer == before);
  device.run(51, 52);
  CHECK_FALSE(has(device.out.missed, Stage::observer));
  CHECK(device.out.external_observer == before);
  device.run(52, 53);
  CHECK(device.out.external_observer != before);
}

TEST_CASE_TEMPLATE("a bad period changes nothing at all", S, float, double) {
  Device<S> device;
  device.run(0, 20);
  const auto before = device.out;
  for (const S bad : bad_periods<S>) {
    auto in = sample<S>(20);
    in.period = bad;
    CHECK(Chain<S>::step(device.config, device.state, in, device.out) == Status::bad_period);
    CHECK(same<S>(device.out, before));
  }
  device.run(20, 40);
  Device<S> straight;
  straight.run(0, 40);
  CHECK(same<S>(device.out, straight.out));
}

TEST_CASE_TEMPLATE("periods that no joint has do not add up until nothing runs any more", S, float,
                   double) {
  auto config = whole_chain<S>();
  config.kalman = typename Chain<S>::Kalman::Config{};
  Device<S> device{config};
  device.run(0, 20);
  auto in = sample<S>(20);
  in.voltage = not_a_number<S>;
  in.period = std::numeric_limits<S>::max();
  CHECK(Chain<S>::step(config, device.state, in, device.out) == Status::bad_period);
  in.period = Chain<S>::longest_period;
  for (int k = 0; k < 1000; ++k) {
    CHECK(Chain<S>::step(config, device.state, in, device.out) == Status::ok);
  }
  device.run(21, 23);
  CHECK(device.out.missed == Stage::none);
}

TEST_CASE_TEMPLATE("a temperature that no instrument measures is no temperature", S, float,
                   double) {
  auto config = whole_chain<S>();
  config.thermistor = std::nullopt;
  Device<S> device{config};
  for (const S absurd : {S(-300), S(1e19), S(20000)}) {
    auto in = sample<S>(0);
    in.temperature = absurd;
    CHECK(Chain<S>::step(config, device.state, in, device.out) == Status::ok);
    CHECK(has(device.out.missed, Stage::compensation));
    CHECK(device.out.temperature == S(0));
  }
}

TEST_CASE_TEMPLATE("any finite channels give finite outputs or a missed stage", S, float, double) {
  std::mt19937_64 random(7);
  Device<S> device;
  using Input = typename Chain<S>::Input;
  const std::array<S Input::*, 10> channels{
      &Input::voltage,      &Input::thermistor_voltage, &Input::sensor_intrinsic,
      &Input::momentum,     &Input::observer_intrinsic, &Input::torsion,
      &Input::gear_known,   &Input::velocity,           &Input::motor_torque,
      &Input::link_momentum};
  for (int i = 0; i < 20000; ++i) {
    Input in = sample<S>(i);
    in.*channels[random() % channels.size()] = any_finite<S>(random);
    device.step(in);
    for (const S value :
         {device.out.temperature, device.out.sensor_torque, device.out.external_sensor,
          device.out.external_observer, device.out.external_compliance,
          device.out.external_compliant_observer, device.out.external_merged}) {
      REQUIRE(math::is_finite(value));
    }
  }
}

TEST_CASE("the sensor waits for the first temperature and goes on with the last") {
  Device<double> device;
  auto in = sample<double>(0);
  in.thermistor_voltage = not_a_number<double>;
  device.step(in);
  CHECK(has(device.out.missed, Stage::sensor));
  device.run(1, 2);
  CHECK(device.out.missed == Stage::none);
  device.step(in);
  CHECK_FALSE(has(device.out.missed, Stage::sensor));
  CHECK(has(device.out.missed, Stage::compensation));
}

TEST_CASE("without thermistor and calibration the channels are taken as they are") {
  Device<double> device;
  device.config = {};
  device.config.sensor = true;
  device.config.compensation = {.coefficients = {0.5}};
  auto in = sample<double>(0);
  in.temperature = 27;
  in.sensor_torque = 4;
  device.step(in);
  CHECK(device.out.temperature == 27);
  CHECK(device.out.sensor_torque == 5);
  CHECK(device.out.external_sensor == 4.8);
  CHECK(device.out.missed == Stage::none);
}

TEST_CASE("flags of the stages that ran are told together") {
  Device<double> device;
  auto in = sample<double>(0);
  in.torsion = -1;
  device.step(in);
  CHECK(device.out.flags == Flag::saturated);
  in.voltage = 1.3;
  device.step(in);
  CHECK(device.out.flags == (Flag::saturated | Flag::extrapolated));
  in = sample<double>(0);
  in.thermistor_voltage = 2.5;  // some −3 °C
  device.step(in);
  CHECK(device.out.flags == Flag::extrapolated);
  in.thermistor_voltage = not_a_number<double>;  // the drift is still that of the last temperature
  device.step(in);
  CHECK(device.out.flags == Flag::extrapolated);
}

TEST_CASE_TEMPLATE("merge and detector take the link's observer where they are told to", S, float,
                   double) {
  Device<S> device;
  device.config.at_rest = AtRest::compliant_observer;
  device.config.watched = Watched::compliant_observer;
  device.config.collision->negative.fill(S(4));
  device.config.collision->positive.fill(S(4));
  int contacts = 0;
  for (int i = 0; i < 2000; ++i) {
    auto in = sample<S>(i);
    in.velocity = S(0);  // λ(0) = 0.378
    device.step(in);
    const auto& out = device.out;
    S weight = 0, merged = 0;
    REQUIRE(device.config.logistic->merge(S(0), out.external_observer,
                                          out.external_compliant_observer, weight,
                                          merged) == Status::ok);
    CHECK(same_bits(out.external_merged, merged));
    CHECK(out.contact == (math::absolute(out.external_compliant_observer) > S(4)));
    contacts += out.contact;
  }
  CHECK(contacts > 100);
  CHECK(contacts < 1900);
  auto in = sample<S>(2000);
  in.link_momentum = not_a_number<S>;
  device.step(in);
  CHECK(device.out.missed == (Stage::compliant_observer | Stage::merge | Stage::collision));
}

TEST_CASE("the observer of a link takes off the inertia that the compliance leaves in") {
  Device<double> device;
  device.config.hysteresis.reset();
  const double inertia = 0.7, push = 3, acceleration = 20;
  for (int i = 0; i < 400; ++i) {
    auto in = sample<double>(i);
    in.gear_known = 0;
    in.torsion = mesh_torsion(push + inertia * acceleration, 15548.0, 0.0487);
    in.link_momentum = inertia * acceleration * 0.001 * i;
    device.step(in);
  }
  const double decay = 60 * 0.399;
  CHECK(device.out.external_compliance == doctest::Approx(push + inertia * acceleration));
  CHECK(device.out.external_compliant_observer ==
        doctest::Approx(push * (1 - std::exp(-decay))).epsilon(1e-9));
}
