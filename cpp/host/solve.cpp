/// Pivoted Cholesky of a Gram, in double or double-double: see solve.hpp.
#include "host/solve.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "host/double_double.hpp"

namespace flexspline::batch {

namespace {

using std::sqrt;

std::size_t index(int i) noexcept { return static_cast<std::size_t>(i); }

/// A square matrix, or the upper factor in it.
template <typename T>
struct Square {
  int size;
  std::vector<T> values;

  explicit Square(int size_) : size(size_), values(index(size_) * index(size_)) {}
  T& operator()(int i, int j) noexcept { return values[index(i) * index(size) + index(j)]; }
  const T& operator()(int i, int j) const noexcept {
    return values[index(i) * index(size) + index(j)];
  }
};

/// A power of two that brings the length of a column near one; 1 for a column of zeros.
double scale_of(double squares) noexcept {
  if (!(squares > 0)) return 1.0;
  int exponent = 0;
  std::frexp(squares, &exponent);
  return std::ldexp(1.0, -(exponent / 2));
}

void require_finite(const Gram& gram) {
  for (std::size_t i = 0; i < gram.high.size(); ++i) {
    if (!std::isfinite(gram.high[i]) || (!gram.low.empty() && !std::isfinite(gram.low[i]))) {
      throw std::invalid_argument("the sums of products of column " +
                                  std::to_string(i / index(gram.columns)) + " are not finite");
    }
  }
}

template <typename T>
T entry(const Gram& gram, int i, int j, double scale) noexcept {
  const std::size_t at = index(i) * index(gram.columns) + index(j);
  if constexpr (std::is_same_v<T, double>) {
    return gram.high[at] * scale;
  } else {
    return T(gram.high[at] * scale, gram.low[at] * scale);
  }
}

/// R (rows 0..rank, columns in the order of the pivots, the target last) of the scaled columns.
template <typename T>
struct Factor {
  int rank = 0;
  std::vector<int> order;     ///< of all columns and the target
  std::vector<double> scale;  ///< in their own order
  std::vector<T> squares;     ///< scaled, in their own order
  std::vector<T> left;        ///< what is left of them, in the order of the pivots
  Square<T> upper;
};

template <typename T>
Factor<T> start(const Gram& gram) {
  Factor<T> f{0, std::vector<int>(index(gram.columns)), {}, {}, {}, Square<T>(gram.columns)};
  std::iota(f.order.begin(), f.order.end(), 0);
  for (int i = 0; i < gram.columns; ++i) {
    f.scale.push_back(scale_of(gram(i, i)));
    f.squares.push_back(entry<T>(gram, i, i, f.scale.back() * f.scale.back()));
  }
  f.left = f.squares;
  return f;
}

/// The column that keeps most of its own length, counted from `rank`; never the target.
template <typename T>
std::pair<int, double> next_pivot(const Factor<T>& f) {
  int best = f.rank;
  double best_ratio = -1;
  for (int j = f.rank; j + 1 < f.upper.size; ++j) {
    const double own = static_cast<double>(f.squares[index(f.order[index(j)])]);
    const double ratio = own > 0 ? static_cast<double>(f.left[index(j)]) / own : 0.0;
    if (ratio > best_ratio) {
      best = j;
      best_ratio = ratio;
    }
  }
  return {best, best_ratio};
}

template <typename T>
void exchange(Factor<T>& f, int a, int b) {
  std::swap(f.order[index(a)], f.order[index(b)]);
  std::swap(f.left[index(a)], f.left[index(b)]);
  for (int i = 0; i < f.rank; ++i) std::swap(f.upper(i, a), f.upper(i, b));
}

/// One more row of R: R_kj = (G_kj - Σ_i<k R_ik R_ij) / R_kk.
template <typename T>
void add_row(Factor<T>& f, const Gram& gram) {
  const int k = f.rank;
  const int row = f.order[index(k)];
  const T pivot = sqrt(f.left[index(k)]);
  f.upper(k, k) = pivot;
  for (int j = k + 1; j < f.upper.size; ++j) {
    const int column = f.order[index(j)];
    T sum = entry<T>(gram, row, column, f.scale[index(row)] * f.scale[index(column)]);
    for (int i = 0; i < k; ++i) sum = sum - f.upper(i, k) * f.upper(i, j);
    const T value = sum / pivot;
    f.upper(k, j) = value;
    f.left[index(j)] = f.left[index(j)] - value * value;
  }
  ++f.rank;
}

template <typename T>
Factor<T> factorise(const Gram& gram, double tolerance) {
  Factor<T> f = start<T>(gram);
  while (f.rank + 1 < gram.columns) {
    const auto [pivot, ratio] = next_pivot(f);
    if (!(ratio > tolerance)) break;
    exchange(f, f.rank, pivot);
    add_row(f, gram);
  }
  return f;
}

/// b of R b = column `right` of R.
template <typename T>
std::vector<T> back_substitute(const Factor<T>& f, int right) {
  std::vector<T> b(index(f.rank));
  for (int i = f.rank - 1; i >= 0; --i) {
    T sum = f.upper(i, right);
    for (int j = i + 1; j < f.rank; ++j) sum = sum - f.upper(i, j) * b[index(j)];
    b[index(i)] = sum / f.upper(i, i);
  }
  return b;
}

/// κ of the basic columns, each scaled to length one: largest over smallest singular value of R.
template <typename T>
double condition_of(const Factor<T>& f) {
  if (f.rank == 0) return 1.0;
  Eigen::MatrixXd r = Eigen::MatrixXd::Zero(f.rank, f.rank);
  for (int j = 0; j < f.rank; ++j) {
    const double length = std::sqrt(static_cast<double>(f.squares[index(f.order[index(j)])]));
    for (int i = 0; i <= j; ++i) r(i, j) = static_cast<double>(f.upper(i, j)) / length;
  }
  const Eigen::VectorXd singular = r.bdcSvd().singularValues();
  return singular(0) / singular(f.rank - 1);
}

template <typename T>
void fill_dependence(const Factor<T>& f, Solution& solution) {
  for (int d = f.rank; d < solution.columns; ++d) {
    const std::vector<T> made_of = back_substitute(f, d);
    const double own = f.scale[index(f.order[index(d)])];
    for (int k = 0; k < f.rank; ++k) {
      solution.dependence.push_back(static_cast<double>(made_of[index(k)]) *
                                    f.scale[index(f.order[index(k)])] / own);
    }
  }
}

template <typename T>
Solution solve_in(const Gram& gram, double tolerance) {
  const Factor<T> f = factorise<T>(gram, tolerance);
  Solution solution;
  const int target = gram.columns - 1;
  const double target_scale = f.scale[index(target)];
  solution.columns = target;
  solution.rank = f.rank;
  solution.order.assign(f.order.begin(), f.order.end() - 1);
  solution.coefficients.assign(index(target), 0.0);
  solution.factor.assign(index(f.rank) * index(target), 0.0);
  const std::vector<T> b = back_substitute(f, target);
  for (int k = 0; k < f.rank; ++k) {
    const int column = f.order[index(k)];
    solution.coefficients[index(column)] =
        static_cast<double>(b[index(k)]) * f.scale[index(column)] / target_scale;
    solution.rotated_target.push_back(static_cast<double>(f.upper(k, target)) / target_scale);
    for (int j = k; j < target; ++j) {
      const int to = f.order[index(j)];
      solution.factor[index(k) * index(target) + index(to)] =
          static_cast<double>(f.upper(k, j)) / f.scale[index(to)];
    }
  }
  fill_dependence(f, solution);
  const double left = static_cast<double>(f.left[index(target)]);
  solution.residual_squares = std::max(0.0, left) / (target_scale * target_scale);
  solution.condition = condition_of(f);
  return solution;
}

}  // namespace

double default_tolerance(const Gram& gram) noexcept {
  return gram.precision() == Precision::double_double ? 1e-24 : 1e-12 * gram.columns;
}

Solution solve(const Gram& gram) { return solve(gram, default_tolerance(gram)); }

Solution solve(const Gram& gram, double tolerance) {
  if (gram.columns < 1) throw std::invalid_argument("sums without a target cannot be solved");
  require_finite(gram);
  if (gram.precision() == Precision::double_double) {
    return solve_in<DoubleDouble>(gram, tolerance);
  }
  return solve_in<double>(gram, tolerance);
}

bool double_is_enough(const Solution& from_plain_sums) noexcept {
  constexpr double epsilon = 0x1p-52;
  const double condition = from_plain_sums.condition;
  return from_plain_sums.rank == from_plain_sums.columns &&
         4 * condition * condition * epsilon <= 1e-9;
}

}  // namespace flexspline::batch
