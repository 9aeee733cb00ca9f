/// Sums of products of columns (Gram matrix): what least squares needs of a block of samples.
///
///   G_ij = Σ_k w_k x_ik x_jk
///
/// A Gram is a value: blocks are added, subtracted (leave one out), pickled and shipped. With a
/// low part it is a double-double sum: products exact, about 31 digits kept.
/// Storage: row-major, columns × columns, symmetric (both triangles filled).
/// No samples: all zero. NaN or infinity in a column: its row and column of G are not finite.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "host/kernels.hpp"

namespace flexspline::batch {

enum class Precision { plain, double_double };

struct Gram {
  explicit Gram(int columns = 0, Precision precision = Precision::plain);

  int columns = 0;
  std::vector<double> high;  ///< columns × columns
  std::vector<double> low;   ///< the same size in double-double, else empty

  [[nodiscard]] Precision precision() const noexcept;
  [[nodiscard]] double operator()(int row, int column) const noexcept;

  /// Adds the samples of one block; call it with 256 to 4096 samples at a time (cache).
  /// `weights` (null: all one) are for plain sums only; in double-double scale the columns by the
  /// square roots of the weights instead, else std::invalid_argument.
  void add(std::span<const double* const> columns_of_block, std::size_t samples,
           const double* weights = nullptr, const Kernels& with = kernels());

  /// Both need the same number of columns (std::invalid_argument). A plain part makes the result
  /// plain.
  Gram& operator+=(const Gram& other);
  Gram& operator-=(const Gram& other);

  /// The Gram of some of the columns, in the order given (repeats allowed).
  [[nodiscard]] Gram select(std::span<const int> chosen) const;
};

}  // namespace flexspline::batch
