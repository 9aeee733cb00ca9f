#include <doctest/doctest.h>

#include <array>
#include <cmath>

#include "estimator_cases.hpp"
#include "flexspline/find_zero.hpp"

using namespace flexspline;

namespace {

struct Counted {
  double (*f)(double);
  mutable int asked = 0;
  double operator()(double x) const {
    ++asked;
    return f(x);
  }
};

/// Functions that fall through zero at 0.3, bracketed by 0 and 1.
constexpr std::array<double (*)(double), 7> falling{
    [](double x) { return 0.3 - x; },
    [](double x) { return std::exp(-5 * x) - std::exp(-1.5); },
    [](double x) { return -std::tanh(50 * (x - 0.3)); },
    [](double x) { return x < 0.3 ? 1e-3 * (0.3 - x) : 1e3 * (0.3 - x); },  // a kink
    [](double x) { return x < 0.3 ? 2.0 : -1.0; },                          // a jump
    [](double x) { return -std::cbrt(x - 0.3); },
    [](double x) { return (0.3 - x) * (0.3 - x) * (0.3 - x); }};

}  // namespace

TEST_CASE("a zero is found to the tolerance, from the side that is not above it") {
  for (const auto f : falling) {
    for (const double tolerance : {1e-3, 1e-9, 1e-14}) {
      const Counted counted{f};
      const double found = find_zero(counted, 0.0, f(0), 1.0, f(1), tolerance);
      CHECK(std::abs(found - 0.3) <= tolerance + 1e-16);
      CHECK(!(f(found) > 0));
      CHECK(counted.asked <= 60);
    }
  }
}

TEST_CASE("what is smooth takes few rounds, and a straight line one") {
  const Counted straight{falling[0]}, smooth{falling[1]};
  (void)find_zero(straight, 0.0, falling[0](0), 1.0, falling[0](1), 1e-14);
  (void)find_zero(smooth, 0.0, falling[1](0), 1.0, falling[1](1), 1e-14);
  CHECK(straight.asked <= 3);
  CHECK(smooth.asked <= 12);
}

TEST_CASE_TEMPLATE("whatever a function says, it ends within the bracket or is NaN", S, float,
                   double) {
  for (const S odd : {not_a_number<S>, std::numeric_limits<S>::infinity(),
                      -std::numeric_limits<S>::infinity(), S(0), S(1), S(-1)}) {
    int asked = 0;
    const auto f = [&](S) {
      ++asked;
      return odd;
    };
    const S found = find_zero(f, S(2), S(1), S(3), S(-1), S(0));
    CHECK((std::isnan(found) || (found >= S(2) && found <= S(3))));
    CHECK(asked <= 60);
  }
  const auto never = [](S) { return S(1); };
  CHECK(find_zero(never, S(2), S(1), S(3), S(0), S(1e-6L)) == S(3));
}
