#include <doctest/doctest.h>

#include <vector>

#include "estimator_cases.hpp"
#include "flexspline/estimators/collision_detector.hpp"

using namespace flexspline;

namespace {

template <typename S>
using Detector = CollisionDetector<S, 3>;

/// Bands: below 0.5, below 1.0, above.
template <typename S>
constexpr typename Detector<S>::Config bands{.negative = {S(1), S(2), S(3)},
                                             .positive = {S(10), S(20), S(30)},
                                             .speed_edges = {S(0.5), S(1)},
                                             .release = S(0.5),
                                             .hold = S(0.25)};

template <typename S>
bool touches(S residual, S velocity) {
  typename Detector<S>::State state;
  bool contact = false;
  REQUIRE(Detector<S>::step(bands<S>, state, residual, velocity, S(0.125), contact) == Status::ok);
  return contact;
}

/// Contact of each residual, at rest, an eighth of a second apart.
template <typename S>
std::vector<bool> watch(const typename Detector<S>::Config& config, const std::vector<S>& residual,
                        typename Detector<S>::State state = {}) {
  std::vector<bool> seen;
  for (const S value : residual) {
    bool contact = false;
    REQUIRE(Detector<S>::step(config, state, value, S(0), S(0.125), contact) == Status::ok);
    seen.push_back(contact);
  }
  return seen;
}

}  // namespace

TEST_CASE_TEMPLATE("each direction and band of speed has its threshold", S, float, double) {
  const std::array<S, 4> speed{S(0.49L), S(0.5), S(0.99L), S(1)};
  const std::array<int, 4> band{1, 2, 2, 3};
  for (std::size_t k = 0; k < speed.size(); ++k) {
    for (const S velocity : {speed[k], -speed[k]}) {
      CHECK_FALSE(touches(S(10 * band[k]), velocity));
      CHECK(touches(S(10 * band[k]) + S(0.01L), velocity));
      CHECK_FALSE(touches(S(-band[k]), velocity));
      CHECK(touches(S(-band[k]) - S(0.01L), velocity));
    }
  }
}

TEST_CASE_TEMPLATE("a contact ends when the torque was within the release for the hold time", S,
                   float, double) {
  using Seen = std::vector<bool>;
  CHECK(watch<S>(bands<S>, {S(0), S(11), S(6), S(6), S(4), S(4), S(4)}) ==
        Seen{false, true, true, true, true, false, false});
  CHECK(watch<S>(bands<S>, {S(11), S(4), S(6), S(4), S(4), S(6)}) ==
        Seen{true, true, true, true, false, false});
  CHECK(watch<S>(bands<S>, {S(-1.5), S(-0.75), S(-0.75), S(-0.25), S(-0.25)}) ==
        Seen{true, true, true, true, false});
}

TEST_CASE_TEMPLATE("without release and hold a contact is the paper's threshold", S, float,
                   double) {
  typename Detector<S>::Config config;
  config.negative.fill(S(0.03L));
  config.positive.fill(S(0.03L));
  CHECK(watch<S>(config, {S(0.0255L), S(0.031L), S(0.0255L), S(-0.04L), S(-0.03L)}) ==
        std::vector<bool>{false, true, false, true, false});
}

TEST_CASE_TEMPLATE("what is not finite leaves a contact alone", S, float, double) {
  typename Detector<S>::State state{S(0.125), true};
  bool contact = true;
  for (const S bad : not_finite<S>) {
    CHECK(Detector<S>::step(bands<S>, state, bad, S(0), S(1), contact) == Status::not_finite);
    CHECK(Detector<S>::step(bands<S>, state, S(0), bad, S(1), contact) == Status::not_finite);
  }
  for (const S bad : bad_periods<S>) {
    CHECK(Detector<S>::step(bands<S>, state, S(0), S(0), bad, contact) == Status::bad_period);
  }
  CHECK(state.contact);
  CHECK(state.calm == S(0.125));
  CHECK(contact);
}

TEST_CASE_TEMPLATE("one band needs no edges", S, float, double) {
  using One = CollisionDetector<S, 1>;
  typename One::State state;
  bool contact = false;
  REQUIRE(One::step({.negative = {S(1)}, .positive = {S(1)}}, state, S(2), S(100), S(1), contact) ==
          Status::ok);
  CHECK(contact);
}
