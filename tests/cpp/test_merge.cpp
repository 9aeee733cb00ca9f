#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "flexspline/estimators/kalman_merge.hpp"
#include "flexspline/estimators/logistic_merge.hpp"

using namespace flexspline;

namespace {

template <typename S>
using Kalman = KalmanMerge<S>;

template <typename S>
constexpr typename Kalman<S>::Config filter{{S(500), S(0.01)}, S(10), S(2), S(1), S(1), S(3)};

template <typename S>
bool same(const typename Kalman<S>::State& a, const typename Kalman<S>::State& b) {
  return same_bits(a.torque, b.torque) && same_bits(a.variance, b.variance) &&
         a.started == b.started;
}

}  // namespace

TEST_CASE_TEMPLATE("at rest 38 % of the paper's m1 is the observer", S, float, double) {
  const LogisticMerge<S> m1{S(500), S(0.001L)}, m2{S(500), S(0.45L)};
  CHECK(static_cast<double>(m1.weight(S(0))) == doctest::Approx(0.378).epsilon(0.002));
  CHECK(static_cast<double>(m1.weight(S(0.001L))) == doctest::Approx(0.5).epsilon(rounding<S>(2)));
  CHECK(m2.weight(S(0)) >= S(0));
  // Exponentials of floats stop at e^−80.
  CHECK(static_cast<double>(m2.weight(S(0))) <= (sizeof(S) == 4 ? 2e-35 : 1e-37));
  CHECK(m2.weight(S(3)) == S(1));
}

TEST_CASE_TEMPLATE("the weight of the observer is even in speed, rises with it and stays in [0, 1]",
                   S, float, double) {
  const LogisticMerge<S> merge{S(30), S(0.1L)};
  S last = 0;
  for (S speed = 0; speed < S(5); speed += S(0.001L)) {
    const S weight = merge.weight(speed);
    CHECK(merge.weight(-speed) == weight);
    CHECK(weight >= last * (S(1) - 4 * std::numeric_limits<S>::epsilon()));
    CHECK(weight <= S(1));
    last = weight;
  }
}

TEST_CASE_TEMPLATE("two estimates that agree are merged to themselves", S, float, double) {
  const LogisticMerge<S> merge{S(500), S(0.001L)};
  for (const S speed : {S(0), S(0.001L), S(1)}) {
    S weight = 0, merged = 0;
    REQUIRE(merge.merge(speed, S(3.7L), S(3.7L), weight, merged) == Status::ok);
    CHECK(merged == S(3.7L));
  }
}

TEST_CASE_TEMPLATE("what is not finite leaves a merged torque alone", S, float, double) {
  const LogisticMerge<S> merge{};
  S weight = S(7), merged = S(8);
  for (const S bad : not_finite<S>) {
    CHECK(merge.merge(bad, S(1), S(1), weight, merged) == Status::not_finite);
    CHECK(merge.merge(S(0), bad, S(1), weight, merged) == Status::not_finite);
    CHECK(merge.merge(S(0), S(1), bad, weight, merged) == Status::not_finite);
  }
  CHECK(weight == S(7));
  CHECK(merged == S(8));
}

TEST_CASE_TEMPLATE("the first merged torque is the mean weighted by the variances", S, float,
                   double) {
  for (const bool moving : {false, true}) {
    typename Kalman<S>::State state;
    S merged = 0;
    REQUIRE(Kalman<S>::step(filter<S>, state, moving ? S(1) : S(0), S(10), S(20), S(1e-3),
                            merged) == Status::ok);
    const double still = 1 / (1 + std::exp(5.0)), part = moving ? 1.0 : still;
    const double o = 4 + part * (1 - 4), c = 1 + part * (9 - 1);
    CHECK(static_cast<double>(merged) ==
          doctest::Approx((10 / o + 20 / c) / (1 / o + 1 / c)).epsilon(rounding<S>(20)));
    CHECK(static_cast<double>(state.variance) ==
          doctest::Approx(1 / (1 / o + 1 / c)).epsilon(rounding<S>(20)));
  }
}

TEST_CASE_TEMPLATE("the variance settles where the walk balances both measurements", S, float,
                   double) {
  typename Kalman<S>::State state;
  S merged = 0;
  for (int k = 0; k < 5000; ++k) {
    REQUIRE(Kalman<S>::step(filter<S>, state, S(1), S(4), S(6), S(1e-3), merged) == Status::ok);
  }
  // 1/P = 1/(P + walk² T) + 1/R, 1/R = 1/1 + 1/9: P² + q P − q R = 0
  const double r = 0.9, q = 100 * 1e-3;
  const double exact = 0.5 * (-q + std::sqrt(q * q + 4 * q * r));
  CHECK(static_cast<double>(state.variance) == doctest::Approx(exact).epsilon(rounding<S>(100)));
  CHECK(static_cast<double>(merged) == doctest::Approx(4.2).epsilon(rounding<S>(200)));
}

TEST_CASE_TEMPLATE("what is not finite leaves the filter alone", S, float, double) {
  typename Kalman<S>::State good;
  S merged = 0;
  REQUIRE(Kalman<S>::step(filter<S>, good, S(0), S(1), S(2), S(1e-3), merged) == Status::ok);
  const S before = merged;
  auto state = good;
  for (const S bad : not_finite<S>) {
    CHECK(Kalman<S>::step(filter<S>, state, bad, S(1), S(1), S(1e-3), merged) ==
          Status::not_finite);
    CHECK(Kalman<S>::step(filter<S>, state, S(0), bad, S(1), S(1e-3), merged) ==
          Status::not_finite);
    CHECK(Kalman<S>::step(filter<S>, state, S(0), S(1), bad, S(1e-3), merged) ==
          Status::not_finite);
  }
  for (const S bad : bad_periods<S>) {
    CHECK(Kalman<S>::step(filter<S>, state, S(0), S(1), S(1), bad, merged) == Status::bad_period);
  }
  CHECK(same<S>(state, good));
  CHECK(same_bits(merged, before));
}

TEST_CASE_TEMPLATE("a filter in two parts equals the filter in one", S, float, double) {
  const auto run = [](typename Kalman<S>::State state, int from, int to) {
    for (int i = from; i < to; ++i) {
      S merged = 0;
      REQUIRE(Kalman<S>::step(filter<S>, state, S(0.05 * std::sin(0.01 * i)), S(std::cos(0.1 * i)),
                              S(std::sin(0.3 * i)), S(2e-3), merged) == Status::ok);
    }
    return state;
  };
  CHECK(same<S>(run(run({}, 0, 130), 130, 400), run({}, 0, 400)));
}
