/// Gram of harmonics 1..n of one angle next to a few dense columns, in O(n) work per sample.
///
///   cos a cos b = (cos(a-b) + cos(a+b)) / 2      sin a sin b = (cos(a-b) - cos(a+b)) / 2
///   sin a cos b = (sin(a+b) + sin(a-b)) / 2
///
/// so the block of the harmonics needs only C_m = Σ w cos mθ and S_m = Σ w sin mθ, m <= 2n, and the
/// rest is cross sums of each dense column with cos mθ, sin mθ, m <= n. Harmonics are made by
/// rotation, started anew from (cos θ, sin θ) at every sample: error below 2e-16 m.
/// A column of ones (the offset) is always there and costs nothing: do not pass it as dense.
///
/// Order of the columns of the Gram: 1, dense..., cos θ, sin θ, cos 2θ, sin 2θ, ...
/// For harmonics k, 2k, 3k... pass cos kθ, sin kθ. Sums are plain doubles: good up to a condition
/// number of about 1e3 (see `double_is_enough`), above it use columns and double-double.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "host/gram.hpp"
#include "host/kernels.hpp"

namespace flexspline::batch {

class TrigSums {
 public:
  TrigSums(int dense, int harmonics);

  /// Adds one block; 512 to 4096 samples at a time. `cosine`, `sine` of the base angle.
  void add(std::span<const double* const> dense_columns, const double* cosine, const double* sine,
           std::size_t samples, const double* weights = nullptr, const Kernels& with = kernels());

  TrigSums& operator+=(const TrigSums& other);
  TrigSums& operator-=(const TrigSums& other);

  /// Gram of [1, dense..., cos θ, sin θ, ..., cos nθ, sin nθ]; `Gram::select` reorders or drops.
  [[nodiscard]] Gram gram() const;

  [[nodiscard]] int dense() const noexcept { return dense_; }
  [[nodiscard]] int harmonics() const noexcept { return harmonics_; }
  [[nodiscard]] int columns() const noexcept { return 1 + dense_ + 2 * harmonics_; }

  /// The raw sums, for storing; layout in the source file.
  [[nodiscard]] const std::vector<double>& sums() const noexcept { return sums_; }

 private:
  int dense_;
  int harmonics_;
  std::vector<double> sums_;
  std::vector<double> work_;
};

}  // namespace flexspline::batch
