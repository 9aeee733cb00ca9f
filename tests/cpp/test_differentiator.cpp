#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "flexspline/estimators/differentiator.hpp"
#include "random_samples.hpp"

using namespace flexspline;

namespace {

template <typename S>
using State = typename Differentiator<S>::State;

/// Runs `count` steps of a position in turns; returns the state.
template <typename S, typename Position>
State<S> run(double bandwidth, double period, int count, Position turns, State<S> state = {},
             int from = 0) {
  for (int i = from; i < from + count; ++i) {
    const double at = turns(i * period);
    const auto phase = Angle<double>::from_turns(at).phase.fraction >> (64 - 8 * sizeof(S));
    REQUIRE(Differentiator<S>::step({S(bandwidth)}, state, {static_cast<math::Bits<S>>(phase)},
                                    S(period)) == Status::ok);
  }
  return state;
}

template <typename Any>
bool same(const Any& a, const Any& b) {
  return a.last.fraction == b.last.fraction && same_bits(a.velocity, b.velocity) &&
         same_bits(a.acceleration, b.acceleration) && a.started == b.started;
}

}  // namespace

TEST_CASE_TEMPLATE("a steady velocity is exact, through many turns", S, float, double) {
  const double speed = -2.5;  // turns/s
  const auto end = run<S>(20, 1e-3, 5000, [&](double t) { return speed * t; });
  const double exact = 2 * 3.141592653589793 * speed;
  // one unit of the fraction over a period, and the filter's own rounding (in proportion to 1/g)
  const double bound = sizeof(S) == 4 ? 5e-6 : 1e-12;
  CHECK(std::abs(static_cast<double>(end.velocity) / exact - 1) <= bound);
  CHECK(std::abs(static_cast<double>(end.acceleration)) <= (sizeof(S) == 4 ? 5e-3 : 1e-9));
}

TEST_CASE("velocity and acceleration are late by what the header says") {
  const double pi = 3.141592653589793;
  for (const double bandwidth : {5.0, 20.0, 100.0}) {
    const double period = 1e-3, rise = 0.5;  // turns/s²
    const int count = 3000;
    const auto end =
        run<double>(bandwidth, period, count, [&](double t) { return 0.5 * rise * t * t; });
    const double now = (count - 1) * period;
    const double delay = now - end.velocity / (2 * pi * rise);
    const double exact = period / std::expm1(2 * pi * bandwidth * period) + period / 2;
    CHECK(delay == doctest::Approx(exact).epsilon(1e-6));
    const double share = std::pow(2 * pi * bandwidth * period, 2) / 12;
    CHECK(delay == doctest::Approx(1 / (2 * pi * bandwidth)).epsilon(1.01 * share));
    CHECK(end.acceleration == doctest::Approx(2 * pi * rise).epsilon(1e-6));
  }
}

TEST_CASE("acceleration is late by twice the delay of velocity") {
  const double pi = 3.141592653589793;
  const double bandwidth = 20, period = 1e-3, jerk = 0.5;  // turns/s³
  const int count = 3000;
  const auto end =
      run<double>(bandwidth, period, count, [&](double t) { return jerk * t * t * t / 6; });
  const double delay = (count - 1) * period - end.acceleration / (2 * pi * jerk);
  const double velocity = period / std::expm1(2 * pi * bandwidth * period) + period / 2;
  CHECK(delay == doctest::Approx(2 * velocity).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("a bad period changes nothing", S, float, double) {
  const auto good = run<S>(20, 1e-3, 50, [](double t) { return t; });
  for (const S bad :
       {S(0), S(-1e-3), std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity()}) {
    auto state = good;
    CHECK(Differentiator<S>::step({}, state, Phase<S>{5}, bad) == Status::bad_period);
    CHECK(same(state, good));
    State<S> fresh;
    CHECK(Differentiator<S>::step({}, fresh, Phase<S>{5}, bad) == Status::bad_period);
    CHECK_FALSE(fresh.started);
  }
}

TEST_CASE_TEMPLATE("nothing that is not finite gets into the state", S, float, double) {
  const auto good = run<S>(20, 1e-3, 50, [](double t) { return t; });
  auto state = good;
  const Phase<S> far{good.last.fraction + (math::Bits<S>(1) << (8 * sizeof(S) - 2))};
  const S tiny = std::numeric_limits<S>::denorm_min();
  CHECK(Differentiator<S>::step({}, state, far, tiny) == Status::not_finite);
  CHECK(same(state, good));
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(Differentiator<S>::step({nan}, state, far, S(1e-3)) == Status::not_finite);
  CHECK(same(state, good));
}

TEST_CASE_TEMPLATE("the first sample starts at rest and a turn's end is no step", S, float,
                   double) {
  State<S> state;
  const Phase<S> nearly{~math::Bits<S>(0)};
  CHECK(Differentiator<S>::step({}, state, nearly, S(1e-3)) == Status::ok);
  CHECK(state.velocity == S(0));
  CHECK(Differentiator<S>::step({}, state, Phase<S>{0}, S(1e-3)) == Status::ok);
  CHECK(state.velocity > S(0));
  CHECK(state.velocity < S(1e-4));
}

TEST_CASE_TEMPLATE("a run in two parts equals the run in one", S, float, double) {
  const auto path = [](double t) { return std::sin(7 * t) + 0.3 * t; };
  const auto whole = run<S>(20, 1e-3, 700, path);
  const auto half = run<S>(20, 1e-3, 300, path);
  CHECK(same(run<S>(20, 1e-3, 400, path, half, 300), whole));
}
