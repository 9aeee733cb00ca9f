#include <doctest/doctest.h>

#include "flexspline/joint.hpp"

using namespace flexspline;

namespace {

constexpr double period = 1e-3;  // s
constexpr double speed = 0.5;    // rad/s

template <typename S>
typename ReadingChecks<S>::Config config() {
  typename ReadingChecks<S>::Config made;
  made.least_voltage = S(-1.6);
  made.most_voltage = S(1.6);
  made.least_thermistor_voltage = S(0.05);
  made.most_thermistor_voltage = S(3.25);
  made.most_speed = S(5);
  made.most_acceleration = S(100);
  made.way = S(0.005);
  made.twist = S(0.3);
  made.gear = Gear<S>::from_ratio(101, OutputSpline::circular, true);
  return made;
}

/// Sample k of a joint that turns steadily.
template <typename S>
Reading<S> turning(int k) {
  const double q = speed * period * k;
  Reading<S> in;
  in.period = S(period);
  in.output_position = Angle<S>::from_radians(S(q));
  in.motor_position = Angle<S>::from_radians(S(101 * q));
  in.output_velocity = S(speed);
  in.output_acceleration = S(0);
  in.sensor_voltage = S(0.2);
  return in;
}

/// After how many samples of a fault it is found; -1 within two seconds never.
template <typename S, typename Break>
int found_after(Fault wanted, Break broken) {
  typename ReadingChecks<S>::State state;
  const auto limits = config<S>();
  for (int k = 0; k < 500; ++k) {
    Reading<S> in = turning<S>(k);
    REQUIRE(ReadingChecks<S>::step(limits, state, in) == Fault::none);
  }
  for (int k = 500; k < 2500; ++k) {
    Reading<S> in = turning<S>(k);
    broken(in, k);
    if (has(ReadingChecks<S>::step(limits, state, in), wanted)) return k - 500;
  }
  return -1;
}

}  // namespace

TEST_CASE_TEMPLATE("each fault of motion is found on the way that it adds", S, float, double) {
  // 0.005 rad at 0.5 rad/s are 10 samples, a little more as some of it is forgotten.
  const auto stuck = [](Reading<S>& in, int) {
    in.output_position = turning<S>(500).output_position;
  };
  CHECK(found_after<S>(Fault::motion, stuck) == doctest::Approx(11).epsilon(0.1));
  const auto swapped = [](Reading<S>& in, int) { in.output_velocity = S(-speed); };
  CHECK(found_after<S>(Fault::motion, swapped) == doctest::Approx(5).epsilon(0.2));
  CHECK(found_after<S>(Fault::speed, swapped) == 0);
  const auto moved = [](Reading<S>& in, int k) {
    in.output_position = Angle<S>::from_radians(S(speed * period * k + 0.02));
  };
  CHECK(found_after<S>(Fault::motion, moved) == 0);
  CHECK(found_after<S>(Fault::speed, moved) == 0);
  CHECK(found_after<S>(Fault::encoders, moved) == 0);
  const auto motor = [](Reading<S>& in, int) {
    in.motor_position = turning<S>(500).motor_position;
  };
  CHECK(found_after<S>(Fault::encoders, motor) == doctest::Approx(6).epsilon(0.2));
  CHECK(found_after<S>(Fault::motion, motor) == -1);
}

TEST_CASE_TEMPLATE("what is out of range is missing afterwards, and nothing else", S, float,
                   double) {
  typename ReadingChecks<S>::State state;
  Reading<S> in = turning<S>(0);
  in.sensor_voltage = S(1.65);
  in.output_velocity = S(-7);
  in.thermistor_voltage = S(3.29);
  const Fault found = ReadingChecks<S>::step(config<S>(), state, in);
  CHECK((has(found, Fault::sensor) && has(found, Fault::speed)));
  CHECK_FALSE(math::is_finite(in.sensor_voltage));
  CHECK_FALSE(math::is_finite(in.output_velocity));
  CHECK((has(found, Fault::temperature) && !math::is_finite(in.thermistor_voltage)));
  CHECK(in.output_acceleration == S(0));
  CHECK(in.motor_position.has_value());
}

TEST_CASE_TEMPLATE("a step is forgotten, absurd ones too, and dropouts are no step", S, float,
                   double) {
  typename ReadingChecks<S>::State state;
  const auto limits = config<S>();
  int last = 0;
  for (int k = 0; k < 3000; ++k) {
    Reading<S> in = turning<S>(k);
    if (k == 1000) in.output_velocity = std::numeric_limits<S>::max();
    if (k % 7 == 0) in.output_position = std::nullopt;
    if (ReadingChecks<S>::step(limits, state, in) != Fault::none) last = k;
  }
  CHECK(last >= 1000);
  CHECK(last <= 1145);  // ln(4) / (10 1/s) behind it, and dropouts
}

TEST_CASE_TEMPLATE("a pause compares nothing, and torques are two witnesses", S, float, double) {
  typename ReadingChecks<S>::State state;
  auto limits = config<S>();
  Reading<S> in = turning<S>(0);
  CHECK(ReadingChecks<S>::step(limits, state, in) == Fault::none);
  in = turning<S>(0);
  in.period = S(0.2);
  in.output_position = Angle<S>::from_radians(S(0.9));
  in.motor_position = Angle<S>::from_radians(S(202));
  CHECK(ReadingChecks<S>::step(limits, state, in) == Fault::none);
  limits.apart = S(1);
  typename Chain<S>::Output out;
  out.external_sensor = S(3);
  out.external_observer = S(2.5);
  CHECK(ReadingChecks<S>::torques(limits, out) == Fault::none);
  out.external_observer = S(-3);
  CHECK(ReadingChecks<S>::torques(limits, out) == Fault::torques);
  out.missed = Stage::observer;
  CHECK(ReadingChecks<S>::torques(limits, out) == Fault::none);
}

TEST_CASE_TEMPLATE("missing readings and a bad period stay what they are", S, float, double) {
  typename ReadingChecks<S>::State state;
  Reading<S> none;
  CHECK(ReadingChecks<S>::step(config<S>(), state, none) == Fault::none);
  none.period = S(-1);
  CHECK(ReadingChecks<S>::step(config<S>(), state, none) == Fault::none);
  none = {};
  none.period = S(period);
  CHECK(ReadingChecks<S>::step(config<S>(), state, none) == Fault::none);
}
