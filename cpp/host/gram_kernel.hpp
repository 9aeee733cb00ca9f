/// Dense Gram, register-tiled: 3 × 4 columns are summed at once, 12 sums stay in registers, so each
/// loaded number is used three or four times. 512 samples at a time keep the columns in the cache.
#pragma once

#include "host/lanes.hpp"

namespace {

constexpr int tile_rows = 3;
constexpr int tile_columns = 4;
constexpr std::size_t gram_block = 512;

/// The samples of one tile: columns left[0..R), right[0..C) from `first` to `last`.
template <typename V, int R, int C, bool weighted>
inline void add_products(const double* const* left, const double* const* right,
                         const double* weights, std::size_t first, std::size_t last,
                         V (&sums)[R][C]) noexcept {
  const double* a[R];
  const double* b[C];
  for (int i = 0; i < R; ++i) a[i] = left[i];
  for (int j = 0; j < C; ++j) b[j] = right[j];
  for (std::size_t k = first; k < last; k += step<V>) {
    V x[R];
    for (int i = 0; i < R; ++i) {
      x[i] = load<V>(a[i] + k);
      if constexpr (weighted) x[i] = x[i] * load<V>(weights + k);
    }
    for (int j = 0; j < C; ++j) {
      const V y = load<V>(b[j] + k);
      for (int i = 0; i < R; ++i) sums[i][j] = fused(x[i], y, sums[i][j]);
    }
  }
}

template <int R, int C, bool weighted>
void gram_tile(const double* const* columns, int row, int column, int count, const double* weights,
               std::size_t first, std::size_t last, double* upper) noexcept {
  const std::size_t bulk = first + (last - first) / width * width;
  Lanes wide[R][C] = {};
  double rest[R][C] = {};
  add_products<Lanes, R, C, weighted>(columns + row, columns + column, weights, first, bulk, wide);
  add_products<double, R, C, weighted>(columns + row, columns + column, weights, bulk, last, rest);
  for (int i = 0; i < R; ++i) {
    for (int j = 0; j < C; ++j) {
      if (column + j >= row + i) {
        upper[(row + i) * count + column + j] += sum_of(wide[i][j]) + rest[i][j];
      }
    }
  }
}

using GramTile = void (*)(const double* const*, int, int, int, const double*, std::size_t,
                          std::size_t, double*) noexcept;

template <bool weighted>
constexpr GramTile gram_tiles[tile_rows][tile_columns] = {
    {gram_tile<1, 1, weighted>, gram_tile<1, 2, weighted>, gram_tile<1, 3, weighted>,
     gram_tile<1, 4, weighted>},
    {gram_tile<2, 1, weighted>, gram_tile<2, 2, weighted>, gram_tile<2, 3, weighted>,
     gram_tile<2, 4, weighted>},
    {gram_tile<3, 1, weighted>, gram_tile<3, 2, weighted>, gram_tile<3, 3, weighted>,
     gram_tile<3, 4, weighted>}};

inline int at_most(int limit, int value) noexcept { return value < limit ? value : limit; }

void gram(const double* const* columns, int count, std::size_t samples, const double* weights,
          double* upper) noexcept {
  for (std::size_t first = 0; first < samples; first += gram_block) {
    const std::size_t last = samples - first < gram_block ? samples : first + gram_block;
    for (int row = 0; row < count; row += tile_rows) {
      const int rows = at_most(tile_rows, count - row);
      for (int column = row; column < count; column += tile_columns) {
        const int across = at_most(tile_columns, count - column);
        const GramTile tile = weights != nullptr ? gram_tiles<true>[rows - 1][across - 1]
                                                 : gram_tiles<false>[rows - 1][across - 1];
        tile(columns, row, column, count, weights, first, last, upper);
      }
    }
  }
}

}  // namespace
