/// A number as the unevaluated sum of two doubles: about 31 decimal digits.
///
///   a + b = s + e exactly (Knuth),   a b = p + e exactly (Dekker's splitting, no FMA needed:
///   the same bits on every machine).   Relative error of each operation below 2⁻¹⁰².
///
/// Products overflow in the splitting beyond 1e292. NaN and infinity stay not finite.
/// This header must be compiled without contraction (-ffp-contract=off) and never with -ffast-math.
/// Source: [Dekker1971]; [Knuth1997], 4.2.2; [Joldes2017].
#pragma once

#include <cmath>

namespace flexspline::batch {

struct DoubleDouble {
  double high = 0;
  double low = 0;

  constexpr DoubleDouble() = default;
  constexpr DoubleDouble(double value) : high(value) {}  // NOLINT: a double is one of these
  constexpr DoubleDouble(double high_part, double low_part) : high(high_part), low(low_part) {}

  explicit constexpr operator double() const noexcept { return high; }
};

/// a + b exactly.
constexpr DoubleDouble two_sum(double a, double b) noexcept {
  const double sum = a + b;
  const double kept = sum - a;
  return {sum, (a - (sum - kept)) + (b - kept)};
}

/// a + b exactly for |a| >= |b|.
constexpr DoubleDouble fast_two_sum(double a, double b) noexcept {
  const double sum = a + b;
  return {sum, b - (sum - a)};
}

/// a b exactly.
constexpr DoubleDouble two_product(double a, double b) noexcept {
  constexpr double splitter = 134217729.0;  // 2²⁷ + 1
  const double product = a * b;
  const double far_a = splitter * a;
  const double far_b = splitter * b;
  const double high_a = far_a - (far_a - a);
  const double high_b = far_b - (far_b - b);
  const double low_a = a - high_a;
  const double low_b = b - high_b;
  return {product, ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b};
}

constexpr DoubleDouble operator-(DoubleDouble a) noexcept { return {-a.high, -a.low}; }

constexpr DoubleDouble operator+(DoubleDouble a, DoubleDouble b) noexcept {
  const DoubleDouble high = two_sum(a.high, b.high);
  const DoubleDouble low = two_sum(a.low, b.low);
  const DoubleDouble once = fast_two_sum(high.high, high.low + low.high);
  return fast_two_sum(once.high, once.low + low.low);
}

constexpr DoubleDouble operator-(DoubleDouble a, DoubleDouble b) noexcept { return a + -b; }

constexpr DoubleDouble operator*(DoubleDouble a, DoubleDouble b) noexcept {
  const DoubleDouble product = two_product(a.high, b.high);
  return fast_two_sum(product.high, product.low + (a.high * b.low + a.low * b.high));
}

constexpr DoubleDouble operator/(DoubleDouble a, DoubleDouble b) noexcept {
  const double first = a.high / b.high;
  const DoubleDouble rest = a - b * DoubleDouble(first);
  const double second = rest.high / b.high;
  const DoubleDouble last = rest - b * DoubleDouble(second);
  return fast_two_sum(first, second) + DoubleDouble(last.high / b.high);
}

/// a >= 0; the root of 0 is 0.
inline DoubleDouble sqrt(DoubleDouble a) noexcept {
  const double root = std::sqrt(a.high);
  if (!(root > 0)) return root;
  const DoubleDouble rest = a - two_product(root, root);
  return fast_two_sum(root, rest.high / (2 * root));
}

}  // namespace flexspline::batch
