#include <doctest/doctest.h>

#include <cmath>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

__extension__ typedef unsigned __int128 Wide;

/// The fraction of Ñ q in 2^−64 turns from the fraction of q in 2^−64 turns, by 128 bits.
std::uint64_t product(std::uint64_t whole, std::uint64_t ratio_fraction, std::int32_t turns,
                      std::uint64_t phase) {
  const auto far = static_cast<std::uint64_t>(static_cast<std::int64_t>(turns));
  return whole * phase + ratio_fraction * far +
         static_cast<std::uint64_t>((static_cast<Wide>(ratio_fraction) * phase) >> 64);
}

}  // namespace

TEST_CASE_TEMPLATE("the motor's phase is exact over a billion turns", S, float, double) {
  std::mt19937_64 random(9);
  for (const double ratio : {1.0, 50.0, 101.0, 160.0, 100.7, 0.25, 30.0 + 1.0 / 3.0}) {
    const auto gear = Gear<S>::from_ratio(ratio, OutputSpline::unknown, false);
    for (int i = 0; i < 20000; ++i) {
      auto q = any_angle<S>(random);
      if (i % 2 == 0) q.turns %= 1000;
      constexpr int spare = 64 - 8 * int(sizeof(S));
      const std::uint64_t exact = product(gear.whole_ratio, gear.ratio_fraction.fraction, q.turns,
                                          std::uint64_t(q.phase.fraction) << spare);
      const auto off = static_cast<std::make_signed_t<math::Bits<S>>>(
          gear.motor_phase(q).fraction - static_cast<math::Bits<S>>(exact >> spare));
      CHECK(std::abs(off) <= 1);
    }
  }
}

TEST_CASE_TEMPLATE("the motor's phase follows long arithmetic on numbers", S, float, double) {
  for (const double ratio : {100.0, 101.0, 50.5, 100.7}) {
    const auto gear = Gear<S>::from_ratio(ratio, OutputSpline::unknown, false);
    for (const double turns : {0.0, 0.125, -0.125, 3.4375, -3.4375, -1000.5, 8191.0625}) {
      const long double theta = static_cast<long double>(ratio) * static_cast<long double>(turns);
      const auto exact = Phase<S>{static_cast<math::Bits<S>>(
          static_cast<std::uint64_t>((theta - std::floor(theta)) * 0x1p64L) >>
          (64 - 8 * sizeof(S)))};
      const auto found = gear.motor_phase(Angle<S>::from_turns(S(turns)));
      CHECK(std::abs((found - exact).shortest()) <= (sizeof(S) == 4 ? S(0x1p-31) : S(0x1p-48)));
    }
  }
}

TEST_CASE_TEMPLATE("the gear's pairs turn as the table of the log format says", S, float, double) {
  std::mt19937_64 random(10);
  for (int i = 0; i < 1000; ++i) {
    const auto q = any_angle<S>(random).phase;
    const auto theta = any_angle<S>(random).phase;
    const auto angles = [&](OutputSpline output) {
      const auto gear = Gear<S>::from_ratio(100, output, true);
      return std::pair{gear.against_flexspline(q, theta).fraction,
                       gear.against_circular_spline(q, theta).fraction};
    };
    CHECK(angles(OutputSpline::circular) == std::pair{theta.fraction, (theta - q).fraction});
    CHECK(angles(OutputSpline::flex) == std::pair{(theta + q).fraction, theta.fraction});
    CHECK(angles(OutputSpline::unknown) == std::pair{theta.fraction, theta.fraction});
  }
}

TEST_CASE_TEMPLATE("a ratio of 100 shows 101 and 100 periods a turn", S, float, double) {
  const auto circular = Gear<S>::from_ratio(101, OutputSpline::circular, false);
  const auto flex = Gear<S>::from_ratio(100, OutputSpline::flex, false);
  std::mt19937_64 random(11);
  for (int i = 0; i < 1000; ++i) {
    const auto q = any_angle<S>(random);
    for (const auto& gear : {circular, flex}) {
      const auto theta = gear.motor_phase(q);
      CHECK(gear.against_flexspline(q.phase, theta).fraction ==
            (math::Bits<S>(101) * q.phase).fraction);
      CHECK(gear.against_circular_spline(q.phase, theta).fraction ==
            (math::Bits<S>(100) * q.phase).fraction);
    }
  }
}
