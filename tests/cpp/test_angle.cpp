#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

__extension__ typedef unsigned __int128 Wide;

template <typename S>
long double turns_of(const Angle<S>& angle) {
  return static_cast<long double>(angle.turns) +
         std::ldexp(static_cast<long double>(angle.phase.fraction), -8 * int(sizeof(S)));
}

/// What the fraction of a turn resolves.
template <typename S>
constexpr long double resolution = sizeof(S) == 4 ? 0x1p-32L : 0x1p-52L;

}  // namespace

TEST_CASE_TEMPLATE("whole turns and simple parts are exact", S, float, double) {
  constexpr math::Bits<S> half = math::Bits<S>(1) << (8 * sizeof(S) - 1);
  for (const std::int32_t whole : {0, 1, -1, 7, -7, 4200, 16777215, 1 << 30, -(1 << 30)}) {
    const auto angle = Angle<S>::from_turns(S(whole));
    CHECK(angle.turns == whole);
    CHECK(angle.phase.fraction == 0);
  }
  CHECK(Angle<S>::from_turns(S(2.5)).turns == 2);
  CHECK(Angle<S>::from_turns(S(2.5)).phase.fraction == half);
  CHECK(Angle<S>::from_turns(S(-2.25)).turns == -3);
  CHECK(Angle<S>::from_turns(S(-2.25)).phase.fraction == half + half / 2);
}

TEST_CASE_TEMPLATE("turns are kept to the resolution on both sides of zero", S, float, double) {
  std::mt19937_64 random(5);
  for (int i = 0; i < 100000; ++i) {
    const double size = std::exp2(std::uniform_real_distribution<double>(-60, 30)(random));
    const S value = S(i % 2 == 0 ? size : -size);
    const auto angle = Angle<S>::from_turns(value);
    CHECK(std::abs(turns_of(angle) - static_cast<long double>(value)) <= resolution<S>);
  }
}

TEST_CASE_TEMPLATE("next to a whole number of turns the turns carry", S, float, double) {
  const S below = std::nextafter(S(1), S(0));
  for (const S value : {below, -below, S(-1e-20), S(1e-20), std::nextafter(S(-1), S(-2)),
                        std::nextafter(S(8), S(0)), std::numeric_limits<S>::denorm_min()}) {
    for (const S side : {value, -value}) {
      const auto angle = Angle<S>::from_turns(side);
      CHECK(std::abs(turns_of(angle) - static_cast<long double>(side)) <= resolution<S>);
    }
  }
}

TEST_CASE_TEMPLATE("beyond 2^30 turns the turns saturate, and NaN counts as far below", S, float,
                   double) {
  constexpr S infinity = std::numeric_limits<S>::infinity();
  for (const S far : {S(1.1e9), S(1e30), std::numeric_limits<S>::max(), infinity}) {
    CHECK(Angle<S>::from_turns(far).turns == (1 << 30) + 128);
    CHECK(Angle<S>::from_turns(-far).turns == -(1 << 30) - 128);
    CHECK(Angle<S>::from_turns(far).phase.fraction == 0);
  }
  const auto nothing = Angle<S>::from_turns(std::numeric_limits<S>::quiet_NaN());
  CHECK(nothing.turns == -(1 << 30) - 128);
  CHECK_FALSE(nothing.in_range());
  CHECK(nothing.phase.fraction == 0);
}

TEST_CASE_TEMPLATE("an encoder that is not finite keeps the last angle", S, float, double) {
  Angle<S> angle{3, {17}};
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(),
                      -std::numeric_limits<S>::infinity()}) {
    CHECK(read_radians(bad, angle) == Status::not_finite);
    CHECK(angle.turns == 3);
    CHECK(angle.phase.fraction == 17);
  }
  CHECK(read_radians(math::pi<S>, angle) == Status::ok);
  CHECK(std::abs(turns_of(angle) - 0.5L) <= std::numeric_limits<S>::epsilon());
}

TEST_CASE_TEMPLATE("radians become turns with two roundings at most", S, float, double) {
  constexpr long double turn = 2 * 3.141592653589793238462643383279502884L;
  std::mt19937_64 random(6);
  for (int i = 0; i < 100000; ++i) {
    const S radians = S(std::normal_distribution<double>(0, 30)(random));
    const long double exact = static_cast<long double>(radians) / turn;
    const auto relative = static_cast<long double>(std::numeric_limits<S>::epsilon());
    const auto angle = Angle<S>::from_radians(radians);
    CHECK(std::abs(turns_of(angle) - exact) <= std::abs(exact) * relative + resolution<S>);
  }
}

TEST_CASE_TEMPLATE("order 4200 of a phase is as good as order 1", S, float, double) {
  constexpr long double turn = 2 * 3.141592653589793238462643383279502884L;
  constexpr int width = 8 * int(sizeof(S));
  std::mt19937_64 random(7);
  for (const std::uint32_t order : {1U, 2U, 320U, 1200U, 4200U, 4294967295U}) {
    long double worst = 0;
    for (int i = 0; i < 20000; ++i) {
      const Phase<S> phase{static_cast<math::Bits<S>>(random())};
      const auto p = (math::Bits<S>(order) * phase).phasor();
      const auto wrapped =  // exact: the integer product modulo one turn
          static_cast<math::Bits<S>>(static_cast<Wide>(phase.fraction) * order);
      const long double angle = turn * std::ldexp(static_cast<long double>(wrapped), -width);
      worst = std::max(worst, std::abs(static_cast<long double>(p.cosine) - std::cos(angle)));
      worst = std::max(worst, std::abs(static_cast<long double>(p.sine) - std::sin(angle)));
    }
    CHECK(worst <= (sizeof(S) == 4 ? 1.21e-7L : 4.5e-16L));
  }
}

TEST_CASE_TEMPLATE("phases add, subtract and take the shortest way", S, float, double) {
  const auto at = [](double turns) { return Angle<S>::from_turns(S(turns)).phase; };
  CHECK((at(0.75) + at(0.5)).fraction == at(0.25).fraction);
  CHECK((at(0.25) - at(0.5)).fraction == at(0.75).fraction);
  CHECK((at(0.125) - at(0.875)).shortest() == S(0.25));
  CHECK((at(0.875) - at(0.125)).shortest() == S(-0.25));
  CHECK(at(0.5).shortest() == S(-0.5));
  CHECK(at(0).shortest() == S(0));
}

TEST_CASE_TEMPLATE("an angle is inside of a range in every turn", S, float, double) {
  const auto flag = [](S radians, S low, S high) {
    return extrapolated(Angle<S>::from_radians(radians), low, high);
  };
  const S turn = S(2) * math::pi<S>;
  for (const int turns : {-7, -1, 0, 1, 100}) {
    const S zero = turn * S(turns);
    CHECK(flag(zero + S(0.5), S(0.25), S(1)) == Flag::none);
    CHECK(flag(zero + S(0.125), S(0.25), S(1)) == Flag::extrapolated);
    CHECK(flag(zero + S(1.125), S(0.25), S(1)) == Flag::extrapolated);
    CHECK(flag(zero + S(0.5), zero - S(0.25), zero + S(1)) == Flag::none);
    CHECK(flag(zero + S(3), zero - S(0.25), zero + S(1)) == Flag::extrapolated);
    CHECK(flag(zero + S(3), S(-4), S(4)) == Flag::none);  // more than a turn
  }
  CHECK(flag(S(0.25), S(0.25), S(0.25)) == Flag::none);
  CHECK(flag(S(0.5), S(0.25), S(0.25)) == Flag::extrapolated);
  CHECK(flag(S(3), S(0), turn) == Flag::none);
}

TEST_CASE("the upper half of a product is that of 128 bits") {
  std::mt19937_64 random(8);
  const std::uint64_t most = ~std::uint64_t(0);
  const auto exact = [](std::uint64_t a, std::uint64_t b) {
    return static_cast<std::uint64_t>((static_cast<Wide>(a) * b) >> 64);
  };
  CHECK(multiply_high(most, most) == exact(most, most));
  CHECK(multiply_high(most, 1) == 0);
  for (int i = 0; i < 100000; ++i) {
    const std::uint64_t a = random() >> (random() % 64);
    const std::uint64_t b = random() >> (random() % 64);
    CHECK(multiply_high(a, b) == exact(a, b));
  }
}
