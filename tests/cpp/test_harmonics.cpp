#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

constexpr std::size_t most = 20;

template <typename S>
OutputRipple<S, most> ripple(const std::vector<std::uint32_t>& orders) {
  OutputRipple<S, most> effect;
  std::vector<Harmonic> harmonics;
  for (const std::uint32_t order : orders) harmonics.push_back({order, Pair::output_on_housing});
  effect.assign(harmonics);
  return effect;
}

template <typename S>
Sample<S> at_phase(math::Bits<S> fraction) {
  Sample<S> at;
  at.output_position.phase.fraction = fraction;
  return at;
}

/// Largest error of a row over random angles against long double, over that of its steps.
template <typename S>
long double worst_error_per_step(const std::vector<std::uint32_t>& orders) {
  constexpr long double turn = 2 * 3.141592653589793238462643383279502884L;
  const auto effect = ripple<S>(orders);
  std::mt19937_64 random(30);
  long double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const auto fraction = static_cast<math::Bits<S>>(random());
    const auto row = effect.row(at_phase<S>(fraction));
    for (std::size_t k = 0; k < orders.size(); ++k) {
      const auto wrapped = static_cast<math::Bits<S>>(orders[k] * fraction);
      const long double angle =
          turn * std::ldexp(static_cast<long double>(wrapped), -8 * int(sizeof(S)));
      const long double steps = effect.recurrences()[k].steps;
      const auto error = [&](S found, long double exact) {
        return std::abs(static_cast<long double>(found) - exact) / steps;
      };
      worst = std::max(
          {worst, error(row[2 * k], std::cos(angle)), error(row[2 * k + 1], std::sin(angle))});
    }
  }
  return worst;
}

/// Steps of each order.
std::vector<int> steps(const std::vector<std::uint32_t>& orders) {
  std::vector<int> found;
  const auto effect = ripple<float>(orders);
  for (const Recurrence& recurrence : effect.recurrences()) found.push_back(recurrence.steps);
  return found;
}

std::vector<std::uint32_t> first(std::uint32_t count) {
  std::vector<std::uint32_t> orders;
  for (std::uint32_t k = 1; k <= count; ++k) orders.push_back(k);
  return orders;
}

}  // namespace

TEST_CASE_TEMPLATE("the error of a harmonic grows with its steps alone", S, float, double) {
  const long double most_a_step = sizeof(S) == 4 ? 1.4e-7L : 5.4e-16L;
  CHECK(worst_error_per_step<S>(first(20)) <= most_a_step);
  CHECK(worst_error_per_step<S>({2, 4, 6, 8, 10, 12, 14, 16, 18, 20}) <= most_a_step);
  CHECK(worst_error_per_step<S>({320, 640, 960, 1200, 1280, 4200}) <= most_a_step);
}

TEST_CASE_TEMPLATE("an order by itself is as good as one phasor, however high", S, float, double) {
  const std::vector<std::uint32_t> alone{3, 5, 7, 101, 320, 1200, 4200, 1000000};
  CHECK(steps(alone) == std::vector<int>(alone.size(), 1));
  CHECK(worst_error_per_step<S>(alone) <= (sizeof(S) == 4 ? 1.21e-7L : 4.5e-16L));
}

TEST_CASE("orders are added up from those before, in sixteen steps at most") {
  CHECK(steps(first(20)) ==
        std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 1, 2, 3, 4});
  CHECK(steps({2, 4, 6, 8, 10}) == std::vector<int>{1, 2, 3, 4, 5});
  CHECK(steps({1, 2, 3, 4, 6, 8, 101, 202, 303, 320}) ==
        std::vector<int>{1, 2, 3, 4, 6, 8, 1, 2, 3, 1});
  CHECK(steps({4, 2, 1}) == std::vector<int>{1, 1, 1});
  CHECK(steps({2147483648U, 4294967295U, 1}) == std::vector<int>{1, 1, 1});
}

TEST_CASE_TEMPLATE("every recurrence leads to its order, whatever the list", S, float, double) {
  std::mt19937_64 random(31);
  for (int list = 0; list < 300; ++list) {
    std::vector<std::uint32_t> orders(most);
    for (auto& order : orders) order = 1 + static_cast<std::uint32_t>(random() % 40);
    const auto effect = ripple<S>(orders);
    const auto at = at_phase<S>(static_cast<math::Bits<S>>(random()));
    const auto row = effect.row(at);
    for (std::size_t k = 0; k < most; ++k) {
      const Recurrence recurrence = effect.recurrences()[k];
      const auto p = (math::Bits<S>(orders[k]) * at.output_position.phase).phasor();
      const S bound = S(3) * S(recurrence.steps) * std::numeric_limits<S>::epsilon();
      CHECK(math::absolute(row[2 * k] - p.cosine) <= bound);
      CHECK(math::absolute(row[2 * k + 1] - p.sine) <= bound);
      if (recurrence.steps == 1) {
        CHECK(same_bits(row[2 * k], p.cosine));
        continue;
      }
      REQUIRE((recurrence.from <= recurrence.by && recurrence.by < k));
      CHECK(orders[recurrence.from] + orders[recurrence.by] == orders[k]);
    }
  }
}

TEST_CASE_TEMPLATE("harmonics beyond the count are zero and change no other", S, float, double) {
  const auto all = ripple<S>(first(20));
  const auto some = ripple<S>(first(5));
  const auto at = at_phase<S>(static_cast<math::Bits<S>>(0x9e3779b97f4a7c15ULL));
  const auto row = all.row(at);
  const auto short_row = some.row(at);
  for (std::size_t k = 0; k < 2 * most; ++k) {
    CHECK(short_row[k] == (k < 10 ? row[k] : S(0)));
  }
}

TEST_CASE_TEMPLATE("each pair turns its own harmonics", S, float, double) {
  const WaveGeneratorRipple<S, 4> effect{{{{{1, Pair::wave_generator_on_circular_spline},
                                            {2, Pair::wave_generator_on_circular_spline},
                                            {2, Pair::wave_generator_on_flexspline},
                                            {3, Pair::wave_generator_on_flexspline}}}}};
  CHECK(effect.recurrences()[1].steps == 2);
  CHECK(effect.recurrences()[2].steps == 1);
  CHECK(effect.recurrences()[3].steps == 1);
  Sample<S> at;
  at.wave_generator_on_circular_spline = Angle<S>::from_turns(S(0.25)).phase;
  at.wave_generator_on_flexspline = Angle<S>::from_turns(S(0.5)).phase;
  CHECK(effect.row(at) == Row<S, 8>{S(0), S(1), S(-1), S(0), S(1), S(0), S(-1), S(0)});
}
