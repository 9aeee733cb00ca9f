#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

constexpr std::size_t most = 20;

template <typename S>
OutputRipple<S, most> ripple(const std::vector<std::uint32_t>& orders) {
  OutputRipple<S, most> effect;
  for (std::size_t k = 0; k < orders.size(); ++k) effect.harmonics[k].order = orders[k];
  effect.count = orders.size();
  return effect;
}

template <typename S>
Sample<S> at_phase(math::Bits<S> fraction) {
  Sample<S> at;
  at.output_position.phase.fraction = fraction;
  return at;
}

/// Largest error of a row over random angles, against long double.
template <typename S>
long double worst_error(const std::vector<std::uint32_t>& orders) {
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
      worst = std::max(worst, std::abs(static_cast<long double>(row[2 * k]) - std::cos(angle)));
      worst = std::max(worst, std::abs(static_cast<long double>(row[2 * k + 1]) - std::sin(angle)));
    }
  }
  return worst;
}

std::vector<std::uint32_t> first(std::uint32_t count) {
  std::vector<std::uint32_t> orders;
  for (std::uint32_t k = 1; k <= count; ++k) orders.push_back(k);
  return orders;
}

}  // namespace

TEST_CASE_TEMPLATE("twenty harmonics by rotation in groups of eight stay accurate", S, float,
                   double) {
  // Seven rotations at most; each adds what cosine and sine of one angle lack, and its rounding.
  CHECK(worst_error<S>(first(20)) <= (sizeof(S) == 4 ? 1.2e-6L : 5e-15L));
}

TEST_CASE_TEMPLATE("sparse orders are each as good as one phasor", S, float, double) {
  CHECK(worst_error<S>({2, 4, 8, 101, 320, 1200, 4200}) <= (sizeof(S) == 4 ? 1.21e-7L : 4.5e-16L));
}

TEST_CASE_TEMPLATE("a group starts anew after eight harmonics", S, float, double) {
  const auto effect = ripple<S>(first(20));
  for (std::size_t k = 0; k < 20; ++k) CHECK(effect.continues(k) == (k % 8 != 0));
  const auto at = at_phase<S>(static_cast<math::Bits<S>>(0x9e3779b97f4a7c15ULL));
  const auto row = effect.row(at);
  for (const std::size_t k : {0U, 8U, 16U}) {
    const auto p = (math::Bits<S>(k + 1) * at.output_position.phase).phasor();
    CHECK(same_bits(row[2 * k], p.cosine));
    CHECK(same_bits(row[2 * k + 1], p.sine));
  }
}

TEST_CASE_TEMPLATE("harmonics beyond the count are zero and change no other", S, float, double) {
  const auto all = ripple<S>(first(20));
  auto some = all;
  some.count = 5;
  const auto at = at_phase<S>(static_cast<math::Bits<S>>(0x9e3779b97f4a7c15ULL));
  const auto row = all.row(at);
  const auto short_row = some.row(at);
  for (std::size_t k = 0; k < 2 * most; ++k) {
    CHECK(short_row[k] == (k < 10 ? row[k] : S(0)));
  }
}

TEST_CASE_TEMPLATE("each pair turns its own harmonics", S, float, double) {
  WaveGeneratorRipple<S, 4> effect;
  effect.harmonics = {{{1, Pair::wave_generator_on_circular_spline},
                       {2, Pair::wave_generator_on_circular_spline},
                       {2, Pair::wave_generator_on_flexspline},
                       {3, Pair::wave_generator_on_flexspline}}};
  CHECK(effect.continues(1));
  CHECK_FALSE(effect.continues(2));
  CHECK(effect.continues(3));
  Sample<S> at;
  at.wave_generator_on_circular_spline = Angle<S>::from_turns(S(0.25)).phase;
  at.wave_generator_on_flexspline = Angle<S>::from_turns(S(0.5)).phase;
  CHECK(effect.row(at) == Row<S, 8>{S(0), S(1), S(-1), S(0), S(1), S(0), S(-1), S(0)});
}
