/// Truncated power series: what the motion of a smooth joint is written in.
///
///   a(σ) = Σ a_k σᵏ,    (a b)_k = Σ a_j b_{k−j},  j = 0 … k
///
/// Coefficients come one order after the other, as the recurrences of an equation give them.
/// Source: [Moore1966], chapter 11; [JorbaZou2005], section 2.
#pragma once

#include <array>
#include <cstddef>

namespace flexspline::batch::simulation {

inline constexpr std::size_t most_terms = 24;

using Coefficients = std::array<double, most_terms + 2>;

/// 1/k; 0 at k = 0.
inline constexpr Coefficients reciprocal = [] {
  Coefficients values{};
  for (std::size_t k = 1; k < values.size(); ++k) values[k] = 1.0 / static_cast<double>(k);
  return values;
}();

/// Coefficient k of a b, in two sums that run side by side.
constexpr double product(const Coefficients& a, const Coefficients& b, std::size_t k) noexcept {
  double even = 0;
  double odd = 0;
  std::size_t j = 0;
  for (; j < k; j += 2) {
    even += a[j] * b[k - j];
    odd += a[j + 1] * b[k - j - 1];
  }
  if (j == k) even += a[k] * b[0];
  return even + odd;
}

/// Coefficient k of a².
constexpr double square(const Coefficients& a, std::size_t k) noexcept {
  double sum = 0;
  for (std::size_t j = 0; 2 * j < k; ++j) sum += a[j] * a[k - j];
  const double middle = k % 2 == 0 ? a[k / 2] : 0;
  return 2 * sum + middle * middle;
}

/// a(σ), of the terms up to `order`.
constexpr double value(const Coefficients& a, std::size_t order, double sigma) noexcept {
  double sum = a[order];
  for (std::size_t k = order; k > 0; --k) sum = a[k - 1] + sigma * sum;
  return sum;
}

/// The series that starts at `start` and has the derivative `unit` · a, a up to `order`; it has one
/// term more.
constexpr Coefficients integral(const Coefficients& a, std::size_t order, double unit,
                                double start) noexcept {
  Coefficients sum;
  sum[0] = start;
  for (std::size_t k = 0; k <= order; ++k) sum[k + 1] = unit * reciprocal[k + 1] * a[k];
  return sum;
}

}  // namespace flexspline::batch::simulation
