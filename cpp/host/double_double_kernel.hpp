/// Gram with exact products in double-double sums.
///
///   x y = p + e exactly        (e by one fused instruction, else by Dekker's splitting)
///   S + p = t + r exactly      (Knuth's two-sum);   S <- t,   L <- L + (r + e)
///
/// A sum of 256 samples per lane loses less than 256 · 2⁻¹⁰⁵ of Σ|x y|; blocks are then joined in
/// double-double. Without FMA products beyond 1e292 overflow in the splitting (NaN).
/// Source: [Dekker1971]; [Ogita2005] (Dot2).
#pragma once

#include "host/lanes.hpp"

namespace {

constexpr int exact_tile = 2;
constexpr std::size_t exact_block = 256;

template <typename V>
struct Split {
  V value, high, low;  ///< without FMA: value = high + low, 26 bits each
};

template <typename V>
inline Split<V> split(V x) noexcept {
  if constexpr (has_fma) {
    return {x, x, x};
  } else {
    const V far = all<V>(134217729.0) * x;  // 2²⁷ + 1
    const V high = far - (far - x);
    return {x, high, x - high};
  }
}

template <typename V>
inline V product_error(const Split<V>& x, const Split<V>& y, V product) noexcept {
  if constexpr (has_fma) {
    return fused(x.value, y.value, -product);
  } else {
    return ((x.high * y.high - product) + x.high * y.low + x.low * y.high) + x.low * y.low;
  }
}

template <typename V>
struct ExactSum {
  V high{}, low{};
};

template <typename V>
inline void add_value(ExactSum<V>& sum, V value, V error) noexcept {
  const V total = sum.high + value;
  const V kept = total - sum.high;
  sum.low = sum.low + (((sum.high - (total - kept)) + (value - kept)) + error);
  sum.high = total;
}

template <typename V, int R, int C>
inline void add_exact_products(const double* const* left, const double* const* right,
                               std::size_t first, std::size_t last,
                               ExactSum<V> (&sums)[R][C]) noexcept {
  const double* a[R];
  const double* b[C];
  for (int i = 0; i < R; ++i) a[i] = left[i];
  for (int j = 0; j < C; ++j) b[j] = right[j];
  for (std::size_t k = first; k < last; k += step<V>) {
    Split<V> x[R];
    for (int i = 0; i < R; ++i) x[i] = split(load<V>(a[i] + k));
    for (int j = 0; j < C; ++j) {
      const Split<V> y = split(load<V>(b[j] + k));
      for (int i = 0; i < R; ++i) {
        const V product = x[i].value * y.value;
        add_value(sums[i][j], product, product_error(x[i], y, product));
      }
    }
  }
}

/// (high, low) += (more_high, more_low), renormalised.
inline void join(double& high, double& low, double more_high, double more_low) noexcept {
  ExactSum<double> sum{high, low};
  add_value(sum, more_high, more_low);
  high = sum.high + sum.low;
  low = sum.low - (high - sum.high);
}

template <int R, int C>
void exact_gram_tile(const double* const* columns, int row, int column, int count,
                     std::size_t first, std::size_t last, double* high, double* low) noexcept {
  const std::size_t bulk = first + (last - first) / width * width;
  ExactSum<Lanes> wide[R][C];
  ExactSum<double> rest[R][C];
  add_exact_products<Lanes, R, C>(columns + row, columns + column, first, bulk, wide);
  add_exact_products<double, R, C>(columns + row, columns + column, bulk, last, rest);
  for (int i = 0; i < R; ++i) {
    for (int j = 0; j < C; ++j) {
      if (column + j < row + i) continue;
      const int at = (row + i) * count + column + j;
      for (std::size_t lane = 0; lane < width; ++lane) {
        join(high[at], low[at], wide[i][j].high[lane], wide[i][j].low[lane]);
      }
      join(high[at], low[at], rest[i][j].high, rest[i][j].low);
    }
  }
}

using ExactTile = void (*)(const double* const*, int, int, int, std::size_t, std::size_t, double*,
                           double*) noexcept;

constexpr ExactTile exact_tiles[exact_tile][exact_tile] = {
    {exact_gram_tile<1, 1>, exact_gram_tile<1, 2>}, {exact_gram_tile<2, 1>, exact_gram_tile<2, 2>}};

void gram_double_double(const double* const* columns, int count, std::size_t samples, double* high,
                        double* low) noexcept {
  for (std::size_t first = 0; first < samples; first += exact_block) {
    const std::size_t last = samples - first < exact_block ? samples : first + exact_block;
    for (int row = 0; row < count; row += exact_tile) {
      const int rows = count - row < exact_tile ? count - row : exact_tile;
      for (int column = row; column < count; column += exact_tile) {
        const int across = count - column < exact_tile ? count - column : exact_tile;
        exact_tiles[rows - 1][across - 1](columns, row, column, count, first, last, high, low);
      }
    }
  }
}

}  // namespace
