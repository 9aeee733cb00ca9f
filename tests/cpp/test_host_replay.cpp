#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "host/replay.hpp"
#include "host/replay_estimators.hpp"
#include "host/replay_joint.hpp"

using namespace flexspline;

TEST_CASE("a replay repeats the last good values at bad rows and goes on") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::array<double, 6> time{nan, 0.0, 0.001, 0.001, 0.002, 0.003};
  const std::array<double, 6> position{0.0, 0.0, 0.01, 0.02, nan, 0.03};
  std::array<double, 6> velocity{}, acceleration{};
  batch::replay_differentiator(time.data(), position.data(), time.size(), {50.0}, velocity.data(),
                               acceleration.data());
  CHECK(velocity[0] == 0.0);
  CHECK(velocity[2] > 0.0);
  CHECK(velocity[3] == velocity[2]);
  CHECK(velocity[4] == velocity[2]);
  CHECK(velocity[5] > velocity[2]);
  CHECK(math::is_finite(acceleration[5]));
}

TEST_CASE("a replayed drift is unknown before the first temperature and waits for the next") {
  const double nan = not_a_number<double>;
  const std::array<double, 5> time{0, 1, 2, 3, 4}, temperature{nan, 25, nan, nan, 35};
  std::array<double, 5> torque{};
  TemperatureCompensation<double>::Config config{.coefficients = {1.0}, .thermal_lag = 2.0};
  batch::replay_temperature_compensation(time.data(), temperature.data(), 5, config, torque.data());
  CHECK(std::isnan(torque[0]));
  CHECK(torque[1] == 0);
  CHECK(torque[3] == 0);
  CHECK(torque[4] == doctest::Approx(10 * (1 - std::exp(-1.5))).epsilon(1e-14));
}

TEST_CASE("a replay says at which row Euler cannot be stable") {
  const std::array<double, 5> time{0, 0.01, 0.02, 0.05, 0.06}, zero{};
  std::array<double, 5> external{};
  const auto run = [&](Discretisation how) {
    return batch::replay_observer(time.data(), zero.data(), zero.data(), 5, {100, how},
                                  external.data());
  };
  CHECK(run(Discretisation::euler) == 3);
  CHECK(run(Discretisation::exact) == 5);
}

TEST_CASE("a replayed contact goes on after a bad row") {
  const double nan = not_a_number<double>;
  const std::array<double, 6> time{0, 1, 2, 2, 3, 4}, residual{0, 2, nan, 0, 0.2, 0}, still{};
  std::array<bool, 6> contact{};
  CollisionDetector<double>::Config config{.release = 0.5, .hold = 1.5};
  config.negative.fill(1);
  config.positive.fill(1);
  batch::replay_collision_detector(time.data(), residual.data(), still.data(), 6, config,
                                   contact.data());
  // the good row at 2 s counts from 1 s, that at 3 s ends it
  CHECK(contact == std::array<bool, 6>{false, true, true, true, false, false});
}

TEST_CASE("a row in which time stands still is missed, and the next counts from the one before") {
  const std::array<double, 4> time{0, 0.5, 0.5, 1.5}, torque{1, 2, 9, 3};
  std::array<double, 4> temperature{}, sensor{}, external{};
  std::array<std::uint8_t, 4> flags{}, faults{};
  std::array<std::uint16_t, 4> missed{};
  batch::LogJoint joint;
  joint.sensing.sensor = true;
  joint.estimating.observer = {1.0};
  const std::array<std::size_t, 1> starts{0};
  batch::JointLog log{4, starts, time.data()};
  log.numbers[batch::place_of_reading("sensor_torque")] = torque.data();
  batch::JointResults results{temperature.data(), sensor.data()};
  results.outputs[1] = external.data();
  results.flags = flags.data();
  results.faults = faults.data();
  results.missed = missed.data();
  batch::replay_joint(joint, log, results);
  CHECK(missed == std::array<std::uint16_t, 4>{0, 0, 12, 0});
  CHECK(std::isnan(sensor[2]));
  CHECK(std::isnan(external[2]));
  MomentumObserver<double>::State alone;
  double expected = 0;
  for (const auto& [period, known] : {std::pair{1.0, 1.0}, {0.5, 2.0}, {1.0, 3.0}}) {
    CHECK(MomentumObserver<double>::step({1.0}, alone, 0, known, period, expected) == Status::ok);
  }
  CHECK(external[3] == expected);
}

TEST_CASE("a joint's stages are those that are configured") {
  CHECK(batch::configured(whole_chain<double>()) == Stage{255});
  CHECK(batch::configured({}) == Stage::none);
}
