#include <doctest/doctest.h>

#include <limits>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

/// The effect's row and its negative at the opposite velocity are the same numbers.
template <typename S, typename Effect>
void check_odd_in_velocity(const Effect& effect) {
  std::mt19937_64 random(20);
  for (int i = 0; i < 1000; ++i) {
    auto at = i % 2 == 0 ? usual_sample<S>(random) : any_sample<S>(random);
    const auto forward = effect.row(at);
    at.output_velocity = -at.output_velocity;
    const auto backward = effect.row(at);
    for (std::size_t k = 0; k < forward.size(); ++k) CHECK(backward[k] == -forward[k]);
  }
}

template <typename S, typename Effect>
auto row_at_velocity(const Effect& effect, S velocity) {
  Sample<S> at;
  at.output_velocity = velocity;
  at.load = S(40);
  return effect.row(at);
}

}  // namespace

TEST_CASE_TEMPLATE("friction is odd in velocity", S, float, double) {
  check_odd_in_velocity<S>(CoulombFriction<S>{});
  check_odd_in_velocity<S>(ViscousFriction<S>{});
  check_odd_in_velocity<S>(NonlinearViscousFriction<S>{});
  check_odd_in_velocity<S>(StribeckFriction<S>{});
  check_odd_in_velocity<S>(LoadDependentFriction<S>{});
}

TEST_CASE_TEMPLATE("friction that differs between the directions is even in velocity", S, float,
                   double) {
  std::mt19937_64 random(21);
  const DirectionDependentFriction<S> effect;
  for (int i = 0; i < 1000; ++i) {
    auto at = i % 2 == 0 ? usual_sample<S>(random) : any_sample<S>(random);
    const auto forward = effect.row(at);
    at.output_velocity = -at.output_velocity;
    CHECK(effect.row(at) == forward);
  }
}

TEST_CASE_TEMPLATE("beside level and viscosity it is what forward exceeds the mean by", S, float,
                   double) {
  const S level = S(3), viscosity = S(0.5), more = S(0.25), steeper = S(0.125);
  for (const S speed : {S(0.25), S(1), S(8)}) {
    for (const S way : {S(1), S(-1)}) {
      const S v = way * speed;
      const Row<S, 2> row = row_at_velocity<S>(DirectionDependentFriction<S>{}, v);
      const S torque = level * row_at_velocity<S>(CoulombFriction<S>{}, v)[0] +
                       viscosity * row_at_velocity<S>(ViscousFriction<S>{}, v)[0] + more * row[0] +
                       steeper * row[1];
      CHECK(torque == way * (level + way * more + (viscosity + way * steeper) * speed));
    }
  }
}

TEST_CASE_TEMPLATE("friction is zero at standstill", S, float, double) {
  const auto check = [](const auto& effect) {
    for (const S value : row_at_velocity<S>(effect, 0)) CHECK(value == S(0));
  };
  check(CoulombFriction<S>{});
  check(ViscousFriction<S>{});
  check(NonlinearViscousFriction<S>{});
  check(StribeckFriction<S>{});
  check(LoadDependentFriction<S>{});
  check(DirectionDependentFriction<S>{});
  CHECK(row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, 0) == Row<S, 2>{S(0.5), S(0.5)});
}

TEST_CASE_TEMPLATE("far above its width the direction is one", S, float, double) {
  for (const S v : {S(0.2), S(1), S(1e30), std::numeric_limits<S>::max()}) {
    CHECK(row_at_velocity<S>(CoulombFriction<S>{}, v)[0] == S(1));
    CHECK(row_at_velocity<S>(CoulombFriction<S>{}, -v)[0] == S(-1));
    CHECK(row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, v) == Row<S, 2>{S(1), S(0)});
    CHECK(row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, -v) == Row<S, 2>{S(0), S(1)});
    CHECK(row_at_velocity<S>(LoadDependentFriction<S>{}, v)[0] == S(40));
    CHECK(row_at_velocity<S>(DirectionDependentFriction<S>{}, v) == Row<S, 2>{S(1), v});
    CHECK(row_at_velocity<S>(DirectionDependentFriction<S>{}, -v) == Row<S, 2>{S(1), v});
  }
}

TEST_CASE_TEMPLATE("the two directions add up to one", S, float, double) {
  std::mt19937_64 random(24);
  for (int i = 0; i < 1000; ++i) {
    const S velocity = S(0.01 * std::normal_distribution<double>()(random));
    const auto row = row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, velocity);
    CHECK(math::absolute(row[0] + row[1] - 1) <= std::numeric_limits<S>::epsilon());
  }
}

TEST_CASE_TEMPLATE("within its width the difference between the directions fades with the square",
                   S, float, double) {
  const DirectionDependentFriction<S> effect{S(0.25)};
  const double at_width = std::tanh(1.0);
  for (const S v : {S(0.25), S(-0.25)}) {
    const Row<S, 2> row = row_at_velocity<S>(effect, v);
    CHECK(double(row[0]) == doctest::Approx(at_width * at_width).epsilon(1e-6));
    CHECK(double(row[1]) == doctest::Approx(0.25 * at_width).epsilon(1e-6));
  }
  const Row<S, 2> slow = row_at_velocity<S>(effect, S(0.0025));
  CHECK(double(slow[0]) == doctest::Approx(1e-4).epsilon(1e-3));
  CHECK(double(slow[1]) == doctest::Approx(2.5e-5).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("Stribeck friction has faded far above its velocity", S, float, double) {
  const StribeckFriction<S> effect{S(0.1), S(0.005)};
  for (const S v : {S(10), S(1e10), std::numeric_limits<S>::max()}) {
    CHECK(row_at_velocity<S>(effect, v)[0] <= S(2e-22));
    CHECK(row_at_velocity<S>(effect, v)[0] > S(1e-22));
  }
  const S at_one = row_at_velocity<S>(effect, S(0.1))[0];
  CHECK(at_one == doctest::Approx(std::exp(-1.0)).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("friction by position and by temperature at their edges", S, float, double) {
  Sample<S> at;
  at.output_velocity = S(2);
  CHECK(TemperatureDependentFriction<S>{}.row(at) == Row<S, 2>{S(0), S(0)});
  at.temperature = S(28);
  CHECK(TemperatureDependentFriction<S>{}.row(at) == Row<S, 2>{S(6), S(18)});
  const PositionDependentFriction<S> effect;
  CHECK(effect.row(at) == Row<S, 6>{S(1), S(0), S(1), S(0), S(1), S(0)});
  at.output_position = Angle<S>::from_turns(S(-3.75));
  CHECK(effect.row(at) == Row<S, 6>{S(0), S(1), S(-1), S(0), S(0), S(-1)});
  at.output_velocity = S(0);
  for (const S value : effect.row(at)) CHECK(value == S(0));
  check_odd_in_velocity<S>(TemperatureDependentFriction<S>{});
  check_odd_in_velocity<S>(effect);
}

TEST_CASE_TEMPLATE("before it slips friction depends on the angle since the reversal, not on time",
                   S, float, double) {
  PreslidingFriction<S> effect;
  effect.presliding_width = S(0.8);
  typename PreslidingFriction<S>::State state;
  const double turn = 6.283185307179586;
  const auto row = [&](double angle) {
    Sample<S> at;
    at.output_position = Angle<S>::from_turns(S(angle / turn));
    return effect.row(at, state);
  };
  const auto near = [](const Row<S, 4>& is, std::array<double, 4> should) {
    for (std::size_t k = 0; k < 4; ++k)
      CHECK(double(is[k]) == doctest::Approx(should[k]).epsilon(1e-4));
  };
  near(row(10.0), {0, 0, 0, 0});  // the first sample is the start, wherever it is
  near(row(10.1), {0.125, 0.25, 0.5, 1});
  near(row(10.1), {0.125, 0.25, 0.5, 1});  // at rest it holds
  near(row(10.9), {1, 1, 1, 1});
  CHECK_FALSE(effect.settled(state));
  near(row(10.5), {0.5, 0, -1, -1});
  near(row(12.0), {1, 1, 1, 1});
  CHECK(effect.settled(state));
  near(row(12.0 - 1.7), {-1, -1, -1, -1});
}

TEST_CASE_TEMPLATE("presliding over whole turns goes the short way", S, float, double) {
  PreslidingFriction<S> effect;
  effect.presliding_width = S(1);
  typename PreslidingFriction<S>::State state;
  double work = 0;
  for (int i = 0; i <= 64; ++i) {  // eight turns in steps of an eighth
    Sample<S> at;
    at.output_position = Angle<S>::from_turns(S(i) / S(8));
    work += double(effect.row(at, state)[0]);
  }
  // 0, then π/4, then 1 ever after
  CHECK(work == doctest::Approx(3.141592653589793 / 4 + 63).epsilon(1e-5));
}
