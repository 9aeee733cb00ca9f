#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

constexpr long double turn = 2 * 3.141592653589793238462643383279502884L;

/// Error in units of the last place of `exact`.
template <typename S>
double ulps(S value, long double exact) {
  int exponent = 0;
  std::frexp(exact, &exponent);
  const long double unit = std::ldexp(1.0L, exponent - std::numeric_limits<S>::digits);
  const long double least = std::numeric_limits<S>::denorm_min();
  return static_cast<double>(std::abs(static_cast<long double>(value) - exact) /
                             std::max(unit, least));
}

/// Numbers over the whole range of an exponential, around one, and tiny ones.
template <typename S>
S argument(std::mt19937_64& random, int i) {
  const double limit = sizeof(S) == 4 ? 80 : 700;
  const double wide = std::uniform_real_distribution<double>(-1, 1)(random);
  if (i % 3 == 0) return S(limit * wide);
  if (i % 3 == 1) return S(3 * wide);
  return S(wide * std::exp2(std::uniform_real_distribution<double>(-100, 0)(random)));
}

template <typename S>
constexpr S not_a_number = std::numeric_limits<S>::quiet_NaN();
template <typename S>
constexpr S infinity = std::numeric_limits<S>::infinity();

}  // namespace

TEST_CASE_TEMPLATE("exp, expm1 and tanh err by no more than their headers say", S, float, double) {
  std::mt19937_64 random(1);
  double exp = 0, expm1 = 0, tanh = 0;
  for (int i = 0; i < 300000; ++i) {
    const S x = argument<S>(random, i);
    const auto exact = static_cast<long double>(x);
    exp = std::max(exp, ulps(math::exp(x), std::exp(exact)));
    expm1 = std::max(expm1, ulps(math::expm1(x), std::expm1(exact)));
    tanh = std::max(tanh, ulps(math::tanh(x), std::tanh(exact)));
  }
  CHECK(exp <= 1.5);
  CHECK(expm1 <= 2.5);
  CHECK(tanh <= 3.0);
}

TEST_CASE_TEMPLATE("log, atan and tan err by no more than their headers say", S, float, double) {
  std::mt19937_64 random(5);
  double log = 0, atan = 0, tan = 0, far_tan = 0;
  const S far = sizeof(S) == 4 ? S(10) : S(1000);
  for (int i = 0; i < 300000; ++i) {
    const S any = std::abs(any_finite<S>(random));
    const S near_one = std::exp(argument<S>(random, 3 * (i % 2) + 1) / S(3));
    const S share = std::uniform_real_distribution<S>(-1, 1)(random);
    const S gap = i % 2 == 0 ? share : S(1) - std::exp2(S(-20) * std::abs(share));
    for (const S x : {any, near_one}) {
      if (x > S(0)) log = std::max(log, ulps(math::log(x), std::log(static_cast<long double>(x))));
      atan = std::max(atan, ulps(math::atan(-x), std::atan(-static_cast<long double>(x))));
    }
    const S x = gap * math::pi<S> / S(2);
    tan = std::max(tan, ulps(math::tan(x), std::tan(static_cast<long double>(x))));
    const S y = share * far;
    far_tan = std::max(far_tan, ulps(math::tan(y), std::tan(static_cast<long double>(y))));
  }
  CHECK(log <= 1.0);
  CHECK(atan <= 2.5);
  CHECK(tan <= 3.5);
  CHECK(far_tan <= (sizeof(S) == 4 ? 16 : 4));
}

TEST_CASE_TEMPLATE("log, atan and tan have the right values at the edges", S, float, double) {
  using Limits = std::numeric_limits<S>;
  CHECK(math::log(S(1)) == S(0));
  CHECK(math::log(S(0)) == -infinity<S>);
  CHECK(math::log(infinity<S>) == infinity<S>);
  CHECK(std::isnan(math::log(S(-1))));
  CHECK(std::isnan(math::log(not_a_number<S>)));
  CHECK(math::log(Limits::denorm_min()) == S(std::log(Limits::denorm_min())));
  CHECK(math::atan(infinity<S>) == math::pi<S> / S(2));
  CHECK(math::atan(-infinity<S>) == -math::pi<S> / S(2));
  CHECK(math::atan(S(0)) == S(0));
  CHECK(std::isnan(math::atan(not_a_number<S>)));
  CHECK(math::tan(S(0)) == S(0));
  CHECK(math::is_finite(math::tan(math::pi<S> / S(2))));
  CHECK(std::isnan(math::tan(infinity<S>)));
  CHECK(std::isnan(math::tan(not_a_number<S>)));
}

TEST_CASE_TEMPLATE("atan and tan are odd", S, float, double) {
  std::mt19937_64 random(6);
  for (int i = 0; i < 100000; ++i) {
    const S x = any_finite<S>(random);
    CHECK(math::atan(-x) == -math::atan(x));
    const S y = math::atan(x);
    CHECK(math::tan(-y) == -math::tan(y));
  }
}

TEST_CASE_TEMPLATE("exponentials saturate outside their range", S, float, double) {
  const S limit = sizeof(S) == 4 ? S(80) : S(700);
  for (const S x : {limit * 2, std::numeric_limits<S>::max(), infinity<S>}) {
    CHECK(math::exp(x) == math::exp(limit));
    CHECK(math::exp(-x) == math::exp(-limit));
    CHECK(math::expm1(-x) == S(-1));
    CHECK(math::tanh(x) == S(1));
    CHECK(math::tanh(-x) == S(-1));
  }
  CHECK(math::exp(-limit) >= std::numeric_limits<S>::min());
}

TEST_CASE_TEMPLATE("NaN in gives NaN out", S, float, double) {
  CHECK(std::isnan(math::exp(not_a_number<S>)));
  CHECK(std::isnan(math::expm1(not_a_number<S>)));
  CHECK(std::isnan(math::tanh(not_a_number<S>)));
  CHECK(std::isnan(math::tanh(-not_a_number<S>)));
  CHECK(std::isnan(math::clamp(not_a_number<S>, S(-1), S(1))));
  CHECK_FALSE(math::is_finite(not_a_number<S>));
  CHECK_FALSE(math::is_finite(infinity<S>));
  CHECK_FALSE(math::is_finite(-infinity<S>));
  CHECK(math::is_finite(std::numeric_limits<S>::denorm_min()));
  CHECK(math::is_finite(std::numeric_limits<S>::lowest()));
}

TEST_CASE_TEMPLATE("tanh is odd, exact at zero and never beyond one", S, float, double) {
  std::mt19937_64 random(2);
  CHECK(math::tanh(S(0)) == S(0));
  for (int i = 0; i < 100000; ++i) {
    const S x = any_finite<S>(random);
    CHECK(math::tanh(-x) == -math::tanh(x));
    CHECK(math::absolute(math::tanh(x)) <= S(1));
  }
}

TEST_CASE_TEMPLATE("tanh rises with x but for its rounding", S, float, double) {
  std::mt19937_64 random(3);
  constexpr S epsilon = std::numeric_limits<S>::epsilon();
  for (int i = 0; i < 300; ++i) {
    S x = std::abs(argument<S>(random, i));
    for (int k = 0; k < 300; ++k) {
      const S next = std::nextafter(x, infinity<S>);
      CHECK(math::tanh(next) >= math::tanh(x) * (1 - 3 * epsilon));
      x = next;
    }
  }
  for (S x = 0; x < S(12); x += S(0.01)) CHECK(math::tanh(x + S(0.01)) >= math::tanh(x));
}

TEST_CASE_TEMPLATE("a phasor errs by no more than its header says", S, float, double) {
  std::mt19937_64 random(4);
  constexpr bool narrow = sizeof(S) == 4;
  constexpr int width = 8 * int(sizeof(S));
  long double coarse = 0, any = 0;
  for (int i = 0; i < 300000; ++i) {
    auto fraction = static_cast<math::Bits<S>>(random());
    if (i % 4 == 0) fraction >>= random() % width;
    const bool rounded = !narrow && i % 2 == 0;
    if (rounded) fraction &= ~math::Bits<S>(0xfff);
    const long double angle = turn * std::ldexp(static_cast<long double>(fraction), -width);
    const auto p = math::phasor<S>(fraction);
    const long double error =
        std::max(std::abs(static_cast<long double>(p.cosine) - std::cos(angle)),
                 std::abs(static_cast<long double>(p.sine) - std::sin(angle)));
    (rounded ? coarse : any) = std::max(rounded ? coarse : any, error);
  }
  CHECK(any <= (narrow ? 1.21e-7L : 4.5e-16L));
  CHECK(coarse <= 2e-16L);
}

TEST_CASE_TEMPLATE("a phasor is exact at quarter turns", S, float, double) {
  const math::Bits<S> quarter = math::Bits<S>(1) << (8 * sizeof(S) - 2);
  constexpr std::array<int, 5> cosine{1, 0, -1, 0, 1};
  for (std::size_t k = 0; k < 4; ++k) {
    const auto p = math::phasor<S>(static_cast<math::Bits<S>>(k) * quarter);
    CHECK(p.cosine == S(cosine[k]));
    CHECK(p.sine == S(cosine[(k + 3) % 4]));
  }
}

TEST_CASE_TEMPLATE("a phasor's neighbours across the edge of a quarter agree", S, float, double) {
  const math::Bits<S> eighth = math::Bits<S>(1) << (8 * sizeof(S) - 3);
  const S bound = 4 * std::numeric_limits<S>::epsilon();
  for (math::Bits<S> k = 1; k < 8; k += 2) {
    const auto before = math::phasor<S>(k * eighth - 1);
    const auto behind = math::phasor<S>(k * eighth);
    CHECK(math::absolute(before.cosine - behind.cosine) <= bound);
    CHECK(math::absolute(before.sine - behind.sine) <= bound);
  }
}

TEST_CASE_TEMPLATE("elementary functions are computed by the compiler too", S, float, double) {
  static_assert(math::tanh(S(0)) == S(0) && math::exp(S(0)) == S(1));
  static_assert(math::phasor<S>(0).cosine == S(1));
  static_assert(math::log(S(1)) == S(0) && math::atan(S(0)) == S(0) && math::tan(S(0)) == S(0));
  static_assert(noexcept(math::log(S(1))) && noexcept(math::atan(S(1))) &&
                noexcept(math::tan(S(1))));
  static_assert(noexcept(math::tanh(S(0))) && noexcept(math::exp(S(0))));
  constexpr S at_compile_time = math::tanh(S(0.3L));
  volatile S x = S(0.3L);
  CHECK(same_bits(at_compile_time, math::tanh(S(x))));
}
