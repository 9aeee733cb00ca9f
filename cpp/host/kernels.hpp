/// The inner loops of the batch part, compiled once per instruction set.
///
/// Every kernel exists three times (x86-64 baseline, v3 = AVX2 + FMA, v4 = AVX-512; elsewhere only
/// the baseline) and one table of function pointers is picked at first use by what the processor
/// can run. Sums differ between the tables by rounding only: each has its own width and order of
/// summation. Rows of effects are not made here: they have the same bits everywhere.
///
/// The environment variable FLEXSPLINE_ISA = baseline | v3 | v4 forces a table for the whole
/// process; one that the machine cannot run is ignored and the best below it is taken.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace flexspline::batch {

enum class Isa { baseline, v3, v4 };

inline constexpr std::array<Isa, 3> all_isas{Isa::baseline, Isa::v3, Isa::v4};

/// One instruction set's kernels. Columns are pointers to `samples` doubles each (any alignment).
struct Kernels {
  /// upper[i * count + j] += Σ_k w_k x_ik x_jk for j >= i; `weights` may be null (all one).
  void (*gram)(const double* const* columns, int count, std::size_t samples, const double* weights,
               double* upper) noexcept;

  /// The same with exact products, summed in double-double: (high, low) += Σ_k x_ik x_jk.
  /// Weighted sums: scale the columns by the square roots first.
  void (*gram_double_double)(const double* const* columns, int count, std::size_t samples,
                             double* high, double* low) noexcept;

  /// Sums for dense harmonics 1..harmonics of one angle next to `count` columns: `trig_gram.hpp`.
  void (*trig_sums)(const double* const* columns, int count, const double* cosine,
                    const double* sine, std::size_t samples, const double* weights, int harmonics,
                    double* sums, double* work) noexcept;

  /// cosine[k] = cos(angle[k]), sine[k] = sin(angle[k]); rad, |angle| <= 1e6, error < 2e-16.
  /// Beyond that, for infinity and for NaN: NaN.
  void (*cosine_and_sine)(const double* angle, std::size_t samples, double* cosine,
                          double* sine) noexcept;
};

/// The table in use, its instruction set and its name.
[[nodiscard]] const Kernels& kernels() noexcept;
[[nodiscard]] Isa isa_in_use() noexcept;
[[nodiscard]] std::string_view isa() noexcept;

/// "baseline", "v3" or "v4".
[[nodiscard]] std::string_view name_of(Isa isa) noexcept;

/// The table of one instruction set, null if it was not compiled in or cannot run here.
[[nodiscard]] const Kernels* kernels_of(Isa isa) noexcept;

}  // namespace flexspline::batch
