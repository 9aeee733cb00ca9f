#include <doctest/doctest.h>

#include <vector>

#include "estimator_cases.hpp"
#include "flexspline/estimators/momentum_observer.hpp"

using namespace flexspline;

namespace {

template <typename S>
using Observer = MomentumObserver<S>;

template <typename S>
bool same(const typename Observer<S>::State& a, const typename Observer<S>::State& b) {
  return same_bits(a.momentum, b.momentum) && same_bits(a.known_torque, b.known_torque) &&
         same_bits(a.external, b.external) && same_bits(a.decay, b.decay) &&
         same_bits(a.share, b.share) && a.started == b.started;
}

/// A push from outside that begins at the first sample: ṗ = −push.
template <typename S>
std::vector<double> response(const typename Observer<S>::Config& config, double push, double period,
                             int count) {
  typename Observer<S>::State state;
  std::vector<double> seen;
  for (int k = 0; k < count; ++k) {
    S external = 0;
    REQUIRE(Observer<S>::step(config, state, S(-push * period * k), S(0), S(period), external) ==
            Status::ok);
    seen.push_back(static_cast<double>(external));
  }
  return seen;
}

}  // namespace

TEST_CASE_TEMPLATE("the exact observer follows a step as its low pass does, at any period", S,
                   float, double) {
  for (const double period : {1e-4, 1e-3, 0.01, 0.02, 0.1, 3.0}) {
    const auto seen = response<S>({S(100), Discretisation::exact}, 2.0, period, 100);
    for (std::size_t k = 0; k < seen.size(); ++k) {
      const double exact = 2 * -std::expm1(-100 * period * static_cast<double>(k));
      // momentum of up to 200 periods has that rounding over one period; the gain adds it up
      CHECK(std::abs(seen[k] - exact) <= rounding<S>(4 * (static_cast<double>(k) + 2)));
    }
  }
}

TEST_CASE_TEMPLATE("Euler is dead-beat at a gain of one over the period", S, float, double) {
  const auto seen = response<S>({S(128), Discretisation::euler}, 2.0, 1.0 / 128, 10);
  CHECK(seen[0] == 0.0);
  for (std::size_t k = 1; k < seen.size(); ++k) CHECK(seen[k] == 2.0);
}

TEST_CASE_TEMPLATE("Euler just below two over the period rings, and is refused at two", S, float,
                   double) {
  const double period = 1.0 / 128;
  const S below = S(256) * (S(1) - std::numeric_limits<S>::epsilon());
  const auto seen = response<S>({below, Discretisation::euler}, 2.0, period, 200);
  for (std::size_t k = 2; k < seen.size(); ++k) {
    CHECK(std::abs(seen[k] - seen[k - 1]) == doctest::Approx(4).epsilon(1e-3));
  }
  typename Observer<S>::State state;
  S external = S(7);
  REQUIRE(Observer<S>::step({below}, state, S(0), S(0), S(period), external) == Status::ok);
  external = S(7);
  const auto good = state;
  CHECK(Observer<S>::step({S(256), Discretisation::euler}, state, S(0), S(0), S(period),
                          external) == Status::out_of_range);
  CHECK(same<S>(state, good));
  CHECK(external == S(7));
}

TEST_CASE_TEMPLATE("a gain that is not above zero is refused", S, float, double) {
  for (const S gain : {S(0), S(-80), not_a_number<S>}) {
    typename Observer<S>::State state;
    S external = S(7);
    CHECK(Observer<S>::step({gain}, state, S(1), S(1), S(1e-3), external) == Status::out_of_range);
    CHECK_FALSE(state.started);
    CHECK(external == S(7));
  }
}

TEST_CASE_TEMPLATE("a moving joint starts without a jump", S, float, double) {
  for (const auto how : {Discretisation::exact, Discretisation::euler}) {
    typename Observer<S>::State state;
    S external = S(7);
    REQUIRE(Observer<S>::step({S(100), how}, state, S(35), S(0), S(1e-3), external) == Status::ok);
    CHECK(external == S(0));
    REQUIRE(Observer<S>::step({S(100), how}, state, S(35), S(0), S(1e-3), external) == Status::ok);
    CHECK(external == S(0));
  }
}

TEST_CASE_TEMPLATE("an outward push of the joint on the outside is positive", S, float, double) {
  typename Observer<S>::State state;
  S external = 0;
  for (int k = 0; k < 2000; ++k) {  // the drive gives 5 Nm, nothing moves: the outside holds 5 Nm
    REQUIRE(Observer<S>::step({S(50)}, state, S(0), S(5), S(1e-3), external) == Status::ok);
  }
  CHECK(static_cast<double>(external) == doctest::Approx(5).epsilon(rounding<S>(100)));
}

TEST_CASE("the exact observer sees nothing where a known torque moves a free joint") {
  const double period = 0.01;
  Observer<double>::State state;
  double external = 0;
  for (int k = 0; k < 500; ++k) {  // τ̄ = 3 t, p = 1.5 t²
    const double t = k * period;
    REQUIRE(Observer<double>::step({100}, state, 1.5 * t * t, 3 * t, period, external) ==
            Status::ok);
    CHECK(std::abs(external) <= 1e-11);
  }
}

TEST_CASE("a missed sample costs the exact observer nothing but the sample") {
  Observer<double>::State all, some;
  double one = 0, other = 0;
  const double period = 0.01, nan = not_a_number<double>;
  double waited = 0;
  for (int k = 0; k < 100; ++k) {
    const double momentum = -2 * period * k;
    REQUIRE(Observer<double>::step({30}, all, momentum, 0, period, one) == Status::ok);
    waited += period;
    const bool missed = k % 7 == 3 || k % 7 == 4;
    const Status status =
        Observer<double>::step({30}, some, missed ? nan : momentum, 0, waited, other);
    if (status == Status::ok) waited = 0;
    CHECK((status == Status::not_finite) == missed);
    if (!missed) CHECK(other == doctest::Approx(one).epsilon(1e-12));
  }
}

TEST_CASE_TEMPLATE("what is not finite leaves an observer alone", S, float, double) {
  typename Observer<S>::State good;
  S external = 0;
  REQUIRE(Observer<S>::step({}, good, S(1), S(2), S(1e-3), external) == Status::ok);
  REQUIRE(Observer<S>::step({}, good, S(2), S(3), S(1e-3), external) == Status::ok);
  const S before = external;
  auto state = good;
  for (const S bad : not_finite<S>) {
    CHECK(Observer<S>::step({}, state, bad, S(0), S(1e-3), external) == Status::not_finite);
    CHECK(Observer<S>::step({}, state, S(0), bad, S(1e-3), external) == Status::not_finite);
  }
  for (const S bad : bad_periods<S>) {
    CHECK(Observer<S>::step({}, state, S(0), S(0), bad, external) == Status::bad_period);
  }
  const S huge = std::numeric_limits<S>::max();
  CHECK(Observer<S>::step({}, state, huge, S(0), S(1e-3), external) == Status::not_finite);
  CHECK(same<S>(state, good));
  CHECK(same_bits(external, before));
}

TEST_CASE_TEMPLATE("an observation in two parts equals the one in one", S, float, double) {
  for (const auto how : {Discretisation::exact, Discretisation::euler}) {
    const auto run = [how](typename Observer<S>::State state, int from, int to) {
      for (int i = from; i < to; ++i) {
        S external = 0;
        REQUIRE(Observer<S>::step({S(80), how}, state, S(std::sin(0.1 * i)), S(std::cos(0.2 * i)),
                                  S(2e-3), external) == Status::ok);
      }
      return state;
    };
    CHECK(same<S>(run(run({}, 0, 70), 70, 200), run({}, 0, 200)));
  }
}

TEST_CASE_TEMPLATE("a gain, a period or a discretisation that changes takes effect at once", S,
                   float, double) {
  typename Observer<S>::State state;
  S external = 0;
  double expected = 0;
  const auto step = [&](double gain, double period, Discretisation how, double share) {
    REQUIRE(Observer<S>::step({S(gain), how}, state, S(0), S(3), S(period), external) ==
            Status::ok);
    expected += share * (3 - expected);
    CHECK(static_cast<double>(external) == doctest::Approx(expected).epsilon(rounding<S>(10)));
  };
  step(64, 0.0078125, Discretisation::exact, 0);
  step(64, 0.0078125, Discretisation::exact, -std::expm1(-0.5));
  step(32, 0.0078125, Discretisation::exact, -std::expm1(-0.25));
  step(32, 0.0156250, Discretisation::exact, -std::expm1(-0.5));
  step(64, 0.0078125, Discretisation::exact, -std::expm1(-0.5));
  step(64, 0.0078125, Discretisation::euler, 0.5);
  step(64, 0.0078125, Discretisation::exact, -std::expm1(-0.5));
}
