/// Least squares from a Gram whose last column is the target.
///
///   min |X b - y|²,   G = [X y]ᵀ[X y],   XᵀX = RᵀR,   Rᵀ z = Xᵀy,   R b = z
///
/// R by Cholesky with diagonal pivoting, on columns scaled by powers of two (exact), in
/// double-double when the Gram has a low part. A column whose squared residual after the chosen
/// ones, relative to its own squared length, falls below `tolerance` is dependent: coefficient 0,
/// and `dependence` says of what it is made. Error of the coefficients: about κ² ε, ε = 1e-16
/// plain, 1e-32 double-double, κ = `condition`. A column of zeros is dependent (of nothing). Not
/// finite entries: std::invalid_argument. Source: [Higham2002], Accuracy and Stability of
/// Numerical Algorithms, chapters 10 and 20.
#pragma once

#include <vector>

#include "host/gram.hpp"

namespace flexspline::batch {

struct Solution {
  int columns = 0;  ///< of X
  int rank = 0;
  std::vector<int> order;            ///< pivots first: order[0..rank) are the basic columns
  std::vector<double> coefficients;  ///< columns; 0 at dependent ones
  std::vector<double>
      factor;  ///< rank × columns row-major, columns in their own order: XᵀX = factorᵀ factor
  std::vector<double> rotated_target;  ///< z = Qᵀ y, rank values
  std::vector<double> dependence;      ///< (columns - rank) × rank: column order[rank + d] = Σ_k
                                       ///< dependence[d, k] · column order[k]
  double residual_squares = 0;         ///< |X b - y|², >= 0
  double condition = 1;                ///< κ of the basic columns scaled to length one (estimate)
};

/// 1e-12 × columns for plain sums, 1e-24 for double-double.
[[nodiscard]] double default_tolerance(const Gram& gram) noexcept;

[[nodiscard]] Solution solve(const Gram& gram);
[[nodiscard]] Solution solve(const Gram& gram, double tolerance);

/// Is a solution from plain sums good to 1e-9? True when no column was dropped and
/// 4 κ² 2⁻⁵² <= 1e-9 (κ up to about 1000). Else sum again in double-double.
[[nodiscard]] bool double_is_enough(const Solution& from_plain_sums) noexcept;

}  // namespace flexspline::batch
