/// Where the raw sums of `TrigSums` lie, for D dense columns and n harmonics (all plain doubles):
///
///   Σ w | Σ w d_i: D | Σ w d_i d_j: D × D, upper | C_m, S_m for m = 1..2n | for every dense
///   column: Σ w d cos mθ, Σ w d sin mθ for m = 1..n
///
/// and the working memory of the kernel. Internal linkage: see lanes.hpp.
#pragma once

#include <cstddef>

namespace {

constexpr std::size_t trig_block = 256;

struct TrigLayout {
  std::size_t dense;
  std::size_t harmonics;

  static constexpr std::size_t weight = 0;
  static constexpr std::size_t linear = 1;
  constexpr std::size_t products() const noexcept { return linear + dense; }
  constexpr std::size_t orders() const noexcept { return products() + dense * dense; }
  constexpr std::size_t cross() const noexcept { return orders() + 4 * harmonics; }
  constexpr std::size_t size() const noexcept { return cross() + 2 * dense * harmonics; }

  /// Index of C_m; S_m is the next. m >= 1.
  constexpr std::size_t order(std::size_t m) const noexcept { return orders() + 2 * (m - 1); }
  /// Index of Σ w d cos mθ; Σ w d sin mθ is the next. m >= 1.
  constexpr std::size_t cross(std::size_t column, std::size_t m) const noexcept {
    return cross() + 2 * (column * harmonics + m - 1);
  }

  /// Per harmonic, in units of the widest vector (8): Σ c, Σ s, four squares, two per column.
  constexpr std::size_t lanes() const noexcept { return 6 + 2 * dense; }
  /// Doubles of working memory: the harmonic in hand, then the sums of every lane.
  constexpr std::size_t work() const noexcept { return 2 * trig_block + 8 * harmonics * lanes(); }
};

}  // namespace
