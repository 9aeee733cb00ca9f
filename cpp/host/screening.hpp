/// One pass over runs: the Gram of the filtered columns of a sheet, fold by fold.
///
/// Runs are cut into pieces of about the same length, each with the filter's history and the
/// memory of what came before, so that pieces go in parallel; their sums are added in order, and
/// the result has the same bits for any number of threads. Memory: the pieces at work, never rows
/// times columns.
#pragma once

#include <algorithm>
#include <iterator>

#include "host/filtered.hpp"
#include "host/gram.hpp"
#include "host/parallel.hpp"
#include "host/remembered.hpp"

namespace flexspline::batch {

inline constexpr std::size_t piece_rows = std::size_t{1} << 17;

/// What is summed of one run. `edges`: rows at which its folds begin, and the end of the last.
struct ScreenedRun {
  std::size_t number = 0;  ///< among all runs, by which its memory is known again
  SheetRun run;
  std::vector<Stretch> stretches;
  std::vector<std::size_t> edges;

  std::size_t folds() const noexcept { return edges.size() - 1; }
};

/// Kept rows [first, last) of a stretch, all in one fold if pieces are cut there.
struct Piece {
  std::size_t run = 0;
  std::size_t stretch = 0;
  std::size_t first = 0;
  std::size_t last = 0;
};

/// The first kept row of a stretch at or behind a row of the log.
inline std::size_t kept_before(const Stretch& stretch, const Filter& filter, std::size_t row) {
  if (row <= stretch.first) return 0;
  return (std::min(row, stretch.last) - stretch.first + filter.every - 1) / filter.every;
}

/// Cuts all runs into pieces; at the folds as well if `by_fold`.
inline std::vector<Piece> pieces_of(std::span<const ScreenedRun> runs, const Filter& filter,
                                    bool by_fold) {
  std::vector<Piece> pieces;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (std::size_t s = 0; s < runs[r].stretches.size(); ++s) {
      const Stretch& stretch = runs[r].stretches[s];
      const auto cut = [&](std::size_t first, std::size_t last) {
        const std::size_t step = std::max<std::size_t>(piece_rows / filter.every, 1);
        for (; first < last; first += step) {
          pieces.push_back({r, s, first, std::min(first + step, last)});
        }
      };
      const std::vector<std::size_t>& edges = runs[r].edges;
      std::size_t first = std::max(filter.order(), kept_before(stretch, filter, edges.front()));
      for (std::size_t fold = 1; fold < edges.size(); ++fold) {
        if (!by_fold && fold + 1 < edges.size()) continue;
        const std::size_t last = kept_before(stretch, filter, edges[fold]);
        cut(first, last);
        first = std::max(first, last);
      }
    }
  }
  return pieces;
}

/// The memory before each piece of all runs.
inline std::vector<Memory> memories_of(const Sheet& sheet, std::span<const ScreenedRun> runs,
                                       const Filter& filter, std::span<const Piece> pieces,
                                       Remembered& remembered, int threads) {
  std::vector<Memory> found;
  for (std::size_t r = 0, p = 0; r < runs.size(); ++r) {
    std::vector<std::size_t> rows;
    for (; p < pieces.size() && pieces[p].run == r; ++p) {
      rows.push_back(
          Filtered::begin(runs[r].stretches[pieces[p].stretch], filter, pieces[p].first));
    }
    auto memories =
        memories_of(sheet, runs[r].run.channels, runs[r].number, rows, remembered, threads);
    std::move(memories.begin(), memories.end(), std::back_inserter(found));
  }
  return found;
}

/// Sums of a piece by fold of its run, from fold `first` on.
struct FoldSums {
  std::size_t first = 0;
  std::vector<Gram> grams;
};

/// The sums of one piece. Blocks are cut where a fold ends.
inline FoldSums sums_of(const Sheet& sheet, const ScreenedRun& run, const Filter& filter,
                        const Mixture& held, const Piece& piece, Memory memory) {
  const Stretch& stretch = run.stretches[piece.stretch];
  const int width = static_cast<int>(sheet.columns.size()) + 1;
  std::vector<std::size_t> ends;
  for (const std::size_t edge : run.edges) ends.push_back(kept_before(stretch, filter, edge));
  std::size_t fold = 0;
  while (fold + 2 < ends.size() && ends[fold + 1] <= piece.first) ++fold;
  FoldSums sums{fold, {Gram(width)}};
  const Filtered filtered(sheet, run.run, stretch, filter, held);
  filtered(piece.first, piece.last, std::move(memory),
           [&](std::span<const double* const> columns, std::size_t at, std::size_t count) {
             std::vector<const double*> block(columns.begin(), columns.end());
             while (count > 0) {
               for (; fold + 2 < ends.size() && ends[fold + 1] <= at; ++fold) {
                 sums.grams.emplace_back(width);
               }
               const std::size_t here = std::min(count, ends[fold + 1] - at);
               sums.grams.back().add(block, here);
               for (const double*& column : block) column += here;
               at += here;
               count -= here;
             }
           });
  return sums;
}

/// The Gram of [columns, target] of each fold of each run, in order.
inline std::vector<Gram> screen(const Sheet& sheet, std::span<const ScreenedRun> runs,
                                const Filter& filter, const Mixture& held, Remembered& remembered,
                                int threads) {
  const int width = static_cast<int>(sheet.columns.size()) + 1;
  const auto pieces = pieces_of(runs, filter, false);
  auto memories = memories_of(sheet, runs, filter, pieces, remembered, threads);
  std::vector<FoldSums> sums(pieces.size());
  parallel_blocks(pieces.size(), threads, [&](std::size_t p) {
    sums[p] = sums_of(sheet, runs[pieces[p].run], filter, held, pieces[p], std::move(memories[p]));
  });
  std::vector<std::size_t> offsets{0};
  for (const ScreenedRun& run : runs) offsets.push_back(offsets.back() + run.folds());
  std::vector<Gram> grams(offsets.back(), Gram(width));
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    for (std::size_t k = 0; k < sums[p].grams.size(); ++k) {
      grams[offsets[pieces[p].run] + sums[p].first + k] += sums[p].grams[k];
    }
  }
  return grams;
}

/// What is left of the target of run r when held[f] is taken off in fold f of all runs: to out[r],
/// at the kept rows; other rows are left alone. The sheet has no columns.
inline void left_over(const Sheet& sheet, std::span<const ScreenedRun> runs, const Filter& filter,
                      std::span<const Mixture> held, std::span<double* const> out,
                      Remembered& remembered, int threads) {
  const auto pieces = pieces_of(runs, filter, true);
  auto memories = memories_of(sheet, runs, filter, pieces, remembered, threads);
  std::vector<std::size_t> offsets{0};
  for (const ScreenedRun& run : runs) offsets.push_back(offsets.back() + run.folds());
  parallel_blocks(pieces.size(), threads, [&](std::size_t p) {
    const Piece& piece = pieces[p];
    const ScreenedRun& run = runs[piece.run];
    const Stretch& stretch = run.stretches[piece.stretch];
    const std::size_t row = stretch.first + piece.first * filter.every;
    const auto next = std::upper_bound(run.edges.begin(), run.edges.end() - 1, row);
    const auto fold = static_cast<std::size_t>(next - run.edges.begin()) - 1;
    const Filtered filtered(sheet, run.run, stretch, filter, held[offsets[piece.run] + fold]);
    filtered(piece.first, piece.last, std::move(memories[p]),
             [&](std::span<const double* const> columns, std::size_t at, std::size_t count) {
               double* to = out[piece.run] + stretch.first + at * filter.every;
               for (std::size_t i = 0; i < count; ++i) to[i * filter.every] = columns[0][i];
             });
  });
}

/// The columns and the target of all stretches of one run, unfiltered but low-passed: column k of
/// row i of them at out[k · stride + i].
inline void rows_of(const Sheet& sheet, const ScreenedRun& run, const Mixture& held, double* out,
                    std::size_t stride, Remembered& remembered) {
  const Filter plain;
  std::vector<std::size_t> begins;
  for (const Stretch& stretch : run.stretches) begins.push_back(Filtered::begin(stretch, plain, 0));
  const auto memories = memories_of(sheet, run.run.channels, run.number, begins, remembered, 1);
  for (std::size_t s = 0; s < run.stretches.size(); ++s) {
    const Stretch& stretch = run.stretches[s];
    const Filtered filtered(sheet, run.run, stretch, plain, held);
    filtered(0, stretch.last - stretch.first, memories[s],
             [&](std::span<const double* const> columns, std::size_t at, std::size_t count) {
               for (std::size_t k = 0; k < columns.size(); ++k) {
                 std::copy_n(columns[k], count, out + k * stride + at);
               }
             });
    out += stretch.last - stretch.first;
  }
}

}  // namespace flexspline::batch
