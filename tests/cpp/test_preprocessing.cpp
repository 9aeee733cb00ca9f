#include <doctest/doctest.h>

#include <cmath>

#include "flexspline/joint.hpp"

using namespace flexspline;

namespace {

constexpr double period = 1e-3;  // s
constexpr double speed = -9.0;   // rad/s: some turns
constexpr int settled = 56;      // samples: 7 / (2π 20 Hz)

template <typename S>
using Bare = Joint<S, Model<S>, Model<S>, Model<S>, Model<S>>;

/// A joint that makes both derivatives, and takes out angles that go faster than 20 rad/s.
template <typename S>
Bare<S> bare() {
  Bare<S> made{};
  made.sensing.differentiator = typename Differentiator<S>::Config{S(20)};
  made.sensing.checks.emplace().most_speed = S(20);
  return made;
}

/// Sample k of a joint that turns steadily; counted as an encoder counts, without turns.
template <typename S>
Reading<S> turning(int k, double step = 0.0) {
  Reading<S> in;
  in.period = S(period);
  const auto fine = Angle<double>::from_radians(speed * period * k + step).phase.fraction;
  in.output_position = Angle<S>{0, {static_cast<math::Bits<S>>(fine >> (64 - 8 * sizeof(S)))}};
  return in;
}

template <typename S>
struct Prepared {
  typename Preprocessing<S>::State state;
  Reading<S> in;
  typename Chain<S>::Output out;

  /// Whether the differentiator has a velocity.
  bool step(const Bare<S>& joint, const Reading<S>& read) {
    in = read;
    out = {};
    Preprocessing<S>::step(joint.sensing, state, in, out);
    const bool has_both =
        math::is_finite(in.output_velocity) && math::is_finite(in.output_acceleration);
    REQUIRE(has_both == !has(out.missed, Stage::differentiator));
    return has_both;
  }
};

/// One unit of the fraction over a period, and the filter's own rounding.
template <typename S>
bool steady(const Prepared<S>& made) {
  const double bound = sizeof(S) == 4 ? 5e-6 : 1e-11;
  return std::abs(static_cast<double>(made.in.output_velocity) / speed - 1) <= bound &&
         std::abs(static_cast<double>(made.in.output_acceleration)) <= 1e3 * bound;
}

/// The samples from `first` on until the filter has a velocity.
template <typename S>
int silent(Prepared<S>& made, const Bare<S>& joint, int first, double step = 0.0) {
  for (int k = first;; ++k) {
    if (made.step(joint, turning<S>(k, step))) return k - first;
  }
}

}  // namespace

TEST_CASE_TEMPLATE("a start says nothing until it is forgotten, then a steady velocity is exact", S,
                   float, double) {
  const auto joint = bare<S>();
  Prepared<S> made;
  CHECK(silent(made, joint, 0) == settled);
  CHECK(steady(made));
  for (int k = settled + 1; k < 3000; ++k) REQUIRE(made.step(joint, turning<S>(k)));
  CHECK(steady(made));
}

TEST_CASE_TEMPLATE("a start over an absurd period is not remembered", S, float, double) {
  auto joint = bare<S>();
  joint.sensing.checks.reset();
  Prepared<S> made;
  CHECK_FALSE(made.step(joint, turning<S>(0)));
  Reading<S> hasty = turning<S>(0);
  hasty.output_position->phase.fraction += 1000;
  hasty.period = std::numeric_limits<S>::min();
  CHECK_FALSE(made.step(joint, hasty));
  silent(made, joint, 1);
  CHECK(steady(made));
}

TEST_CASE_TEMPLATE("missing angles are missed and nothing else; a long gap is a start", S, float,
                   double) {
  const auto joint = bare<S>();
  Prepared<S> made;
  silent(made, joint, 0);
  for (int k = settled + 1; k < 600; ++k) {
    Reading<S> in = turning<S>(k);
    if (k % 10 < 4) in.output_position = std::nullopt;
    REQUIRE(made.step(joint, in) == (k % 10 >= 4));
    CHECK((k % 10 < 4 || steady(made)));
  }
  Reading<S> later = turning<S>(600 + settled);
  later.period = S(period * (settled + 1));
  CHECK_FALSE(made.step(joint, later));
  CHECK(silent(made, joint, 601 + settled) == settled - 1);
  CHECK(steady(made));
}

TEST_CASE_TEMPLATE("the way behind an angle that was taken out is not counted", S, float, double) {
  const auto joint = bare<S>();
  Prepared<S> made;
  silent(made, joint, 0);
  CHECK_FALSE(made.step(joint, turning<S>(57, 0.3)));
  CHECK(made.out.faults == Fault::speed);
  CHECK_FALSE(made.step(joint, turning<S>(58)));  // 0.3 rad back
  CHECK_FALSE(made.step(joint, turning<S>(59)));  // the first that is good
  CHECK(made.out.faults == Fault::none);
  CHECK(made.step(joint, turning<S>(60)));
  CHECK(steady(made));
}

TEST_CASE_TEMPLATE("what is made replaces what was read, and nothing else", S, float, double) {
  auto joint = bare<S>();
  for (const Derivatives makes : {Derivatives::velocity, Derivatives::acceleration}) {
    joint.sensing.differentiator->makes = makes;
    Prepared<S> made;
    Reading<S> in = turning<S>(0);
    in.output_velocity = in.output_acceleration = S(5);
    (void)Preprocessing<S>::step(joint.sensing, made.state, made.in = in, made.out);
    const bool velocity = makes == Derivatives::velocity;
    CHECK(math::is_finite(made.in.output_velocity) == !velocity);
    CHECK(math::is_finite(made.in.output_acceleration) == velocity);
  }
}

TEST_CASE_TEMPLATE("a joint with the stages is one without that reads what they give", S, float,
                   double) {
  auto joint = bare<S>();
  joint.sensing.checks->most_sensor_torque = S(2);
  joint.sensing.sensor = joint.estimating.sensor = true;
  joint.estimating.observer = typename Bare<S>::Chain::Observer::Config{};
  joint.inertia = S(0.5);
  auto plain = joint;
  plain.sensing.checks.reset();
  plain.sensing.differentiator.reset();
  Prepared<S> made;
  typename Bare<S>::State state, other;
  typename Bare<S>::Chain::Output out, same;
  for (int k = 0; k < 500; ++k) {
    Reading<S> in = turning<S>(k, 0.01 * std::sin(0.1 * k));
    in.sensor_torque = S(k % 90 == 7 ? 3 : 1);
    (void)made.step(joint, in);
    REQUIRE(joint.step(state, in, out) == Status::ok);
    REQUIRE(plain.step(other, made.in, same) == Status::ok);
    CHECK(out.external_observer == same.external_observer);
    CHECK(out.missed == (same.missed | made.out.missed));
    CHECK(out.faults == (k % 90 == 7 ? Fault::sensor : Fault::none));
    in.period = S(-period);
    CHECK(joint.step(state, in, out) == Status::bad_period);
  }
  CHECK(out.missed == Stage::none);
}

TEST_CASE("a joint without the stages has no memory for them") {
  struct Few : NoStages<float> {
    typename ReadingChecks<float>::Config checks{};
  };
  using M = Model<float>;
  using Without = Joint<float, M, M, M, M, NoStages<float>, NoStages<float>>;
  using With = Joint<float, M, M, M, M, Few, NoStages<float>>;
  CHECK_FALSE(Without::prepares);
  CHECK(With::prepares);
  CHECK(sizeof(Without::State) + sizeof(Preprocessing<float>::State) <= sizeof(With::State) + 4);
}
