/// A polynomial in time, fitted around each row of a run whose steps are not even.
///
/// Around row r the rows [first, last) count with the weights g_k of a Gaussian of width σ_r,
///
///   g_k = exp(−x_k² / 2),    x_k = (t_k − t_r) / σ_r
///
/// and what is asked for is the d-th derivative of the polynomial of degree n there, a sum of values
/// with weights of their own:
///
///   w_k = g_k Σ_p c_p x_k^p,    Σ_q M_pq c_q = d! / σ_r^d  where p = d, else 0,
///   M_pq = Σ_k g_k x_k^(p + q),                                     0 ≤ p, q ≤ n
///
/// Needs n + 1 rows at different times in each window; the caller sees to it. Equations of a window
/// that cannot be solved give weights that are not finite.
/// Source: [SavitzkyGolay1964] with Gaussian weights ([FanGijbels1996], local polynomials).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

namespace flexspline::batch {

inline constexpr std::size_t most_degree = 4;

/// What is fitted around one row.
struct LocalWindow {
  std::size_t row = 0;
  std::size_t first = 0;
  std::size_t last = 0;
  double sigma = 0.0;  ///< s
};

/// Solves m x = b for a matrix of `size` rows, by elimination with partial pivoting; b becomes x.
inline void solve_small(std::array<std::array<double, most_degree + 1>, most_degree + 1>& m,
                        std::array<double, most_degree + 1>& b, std::size_t size) noexcept {
  for (std::size_t k = 0; k < size; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < size; ++i) {
      if (std::abs(m[i][k]) > std::abs(m[pivot][k])) pivot = i;
    }
    std::swap(m[k], m[pivot]);
    std::swap(b[k], b[pivot]);
    for (std::size_t i = k + 1; i < size; ++i) {
      const double factor = m[i][k] / m[k][k];
      for (std::size_t j = k + 1; j < size; ++j) m[i][j] -= factor * m[k][j];
      b[i] -= factor * b[k];
    }
  }
  for (std::size_t k = size; k-- > 0;) {
    for (std::size_t j = k + 1; j < size; ++j) b[k] -= m[k][j] * b[j];
    b[k] /= m[k][k];
  }
}

/// Writes the weights of the rows [first, last) of a window to out[0 … last − first).
/// degree ≤ 4, derivative ≤ degree.
inline void local_weights(std::span<const double> time, const LocalWindow& window,
                          std::size_t degree, std::size_t derivative, double* out) noexcept {
  std::array<double, 2 * most_degree + 1> moments{};
  for (std::size_t k = window.first; k < window.last; ++k) {
    const double x = (time[k] - time[window.row]) / window.sigma;
    double weight = std::exp(-0.5 * x * x);
    out[k - window.first] = weight;
    for (std::size_t power = 0; power <= 2 * degree; ++power) {
      moments[power] += weight;
      weight *= x;
    }
  }
  std::array<std::array<double, most_degree + 1>, most_degree + 1> m{};
  std::array<double, most_degree + 1> c{};
  for (std::size_t p = 0; p <= degree; ++p) {
    for (std::size_t q = 0; q <= degree; ++q) m[p][q] = moments[p + q];
  }
  c[derivative] = 1.0;
  for (std::size_t d = 1; d <= derivative; ++d) {
    c[derivative] *= static_cast<double>(d) / window.sigma;
  }
  solve_small(m, c, degree + 1);
  for (std::size_t k = window.first; k < window.last; ++k) {
    const double x = (time[k] - time[window.row]) / window.sigma;
    double value = c[degree];
    for (std::size_t p = degree; p-- > 0;) value = value * x + c[p];
    out[k - window.first] *= value;
  }
}

}  // namespace flexspline::batch
