/// One pass over runs: the Gram of the filtered columns of an assembly, fold by fold.
///
/// Runs are cut into chunks of about the same length, each with the filter's history and the
/// memory of what came before, so that chunks go in parallel; their sums are added in order, and
/// the result has the same bits for any number of threads. Memory: the chunks at work, never rows
/// times columns.
#pragma once

#include <algorithm>
#include <iterator>

#include "host/filtered.hpp"
#include "host/gram.hpp"
#include "host/parallel.hpp"
#include "host/state_cache.hpp"

namespace flexspline::batch {

inline constexpr std::size_t chunk_rows = std::size_t{1} << 17;

/// What is summed of one run. `edges`: rows at which its folds begin, and the end of the last.
struct ScreenedRun {
  std::size_t number = 0;  ///< among all runs, by which its memory is known again
  AssemblyRun run;
  std::vector<Segment> segments;
  std::vector<std::size_t> edges;

  std::size_t folds() const noexcept { return edges.size() - 1; }
};

/// Kept rows [first, last) of a segment, all in one fold if chunks are cut there.
struct Chunk {
  std::size_t run = 0;
  std::size_t segment = 0;
  std::size_t first = 0;
  std::size_t last = 0;
};

/// The first kept row of a segment at or behind a row of the log.
inline std::size_t kept_before(const Segment& segment, const Filter& filter, std::size_t row) {
  if (row <= segment.first) return 0;
  return (std::min(row, segment.last) - segment.first + filter.every - 1) / filter.every;
}

/// Cuts all runs into chunks; at the folds as well if `by_fold`.
inline std::vector<Chunk> chunks_of(std::span<const ScreenedRun> runs, const Filter& filter,
                                    bool by_fold) {
  std::vector<Chunk> chunks;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (std::size_t s = 0; s < runs[r].segments.size(); ++s) {
      const Segment& segment = runs[r].segments[s];
      const auto cut = [&](std::size_t first, std::size_t last) {
        const std::size_t step = std::max<std::size_t>(chunk_rows / filter.every, 1);
        for (; first < last; first += step) {
          chunks.push_back({r, s, first, std::min(first + step, last)});
        }
      };
      const std::vector<std::size_t>& edges = runs[r].edges;
      std::size_t first = std::max(filter.order(), kept_before(segment, filter, edges.front()));
      for (std::size_t fold = 1; fold < edges.size(); ++fold) {
        if (!by_fold && fold + 1 < edges.size()) continue;
        const std::size_t last = kept_before(segment, filter, edges[fold]);
        cut(first, last);
        first = std::max(first, last);
      }
    }
  }
  return chunks;
}

/// The memory before each chunk of all runs.
inline std::vector<Memory> memories_of(const ColumnAssembly& assembly,
                                       std::span<const ScreenedRun> runs, const Filter& filter,
                                       std::span<const Chunk> chunks, StateCache& cache,
                                       int threads) {
  std::vector<Memory> found;
  for (std::size_t r = 0, p = 0; r < runs.size(); ++r) {
    std::vector<std::size_t> rows;
    for (; p < chunks.size() && chunks[p].run == r; ++p) {
      rows.push_back(Filtered::begin(runs[r].segments[chunks[p].segment], filter, chunks[p].first));
    }
    auto memories =
        memories_of(assembly, runs[r].run.channels, runs[r].number, rows, cache, threads);
    std::move(memories.begin(), memories.end(), std::back_inserter(found));
  }
  return found;
}

/// Sums of a chunk by fold of its run, from fold `first` on.
struct FoldSums {
  std::size_t first = 0;
  std::vector<Gram> grams;
};

/// The sums of one chunk. Blocks are cut where a fold ends.
inline FoldSums sums_of(const ColumnAssembly& assembly, const ScreenedRun& run,
                        const Filter& filter, const Mixture& offset_terms, const Chunk& chunk,
                        Memory memory) {
  const Segment& segment = run.segments[chunk.segment];
  const int width = static_cast<int>(assembly.columns.size()) + 1;
  std::vector<std::size_t> ends;
  for (const std::size_t edge : run.edges) ends.push_back(kept_before(segment, filter, edge));
  std::size_t fold = 0;
  while (fold + 2 < ends.size() && ends[fold + 1] <= chunk.first) ++fold;
  FoldSums sums{fold, {Gram(width)}};
  const Filtered filtered(assembly, run.run, segment, filter, offset_terms);
  filtered(chunk.first, chunk.last, std::move(memory),
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
inline std::vector<Gram> screen(const ColumnAssembly& assembly, std::span<const ScreenedRun> runs,
                                const Filter& filter, const Mixture& offset_terms,
                                StateCache& cache, int threads) {
  const int width = static_cast<int>(assembly.columns.size()) + 1;
  const auto chunks = chunks_of(runs, filter, false);
  auto memories = memories_of(assembly, runs, filter, chunks, cache, threads);
  std::vector<FoldSums> sums(chunks.size());
  parallel_blocks(chunks.size(), threads, [&](std::size_t p) {
    sums[p] = sums_of(assembly, runs[chunks[p].run], filter, offset_terms, chunks[p],
                      std::move(memories[p]));
  });
  std::vector<std::size_t> offsets{0};
  for (const ScreenedRun& run : runs) offsets.push_back(offsets.back() + run.folds());
  std::vector<Gram> grams(offsets.back(), Gram(width));
  for (std::size_t p = 0; p < chunks.size(); ++p) {
    for (std::size_t k = 0; k < sums[p].grams.size(); ++k) {
      grams[offsets[chunks[p].run] + sums[p].first + k] += sums[p].grams[k];
    }
  }
  return grams;
}

/// The target of run r less offset_terms[f] in fold f of all runs: to out[r], at the kept rows;
/// other rows are left alone. The assembly has no columns.
inline void residuals(const ColumnAssembly& assembly, std::span<const ScreenedRun> runs,
                      const Filter& filter, std::span<const Mixture> offset_terms,
                      std::span<double* const> out, StateCache& cache, int threads) {
  const auto chunks = chunks_of(runs, filter, true);
  auto memories = memories_of(assembly, runs, filter, chunks, cache, threads);
  std::vector<std::size_t> offsets{0};
  for (const ScreenedRun& run : runs) offsets.push_back(offsets.back() + run.folds());
  parallel_blocks(chunks.size(), threads, [&](std::size_t p) {
    const Chunk& chunk = chunks[p];
    const ScreenedRun& run = runs[chunk.run];
    const Segment& segment = run.segments[chunk.segment];
    const std::size_t row = segment.first + chunk.first * filter.every;
    const auto next = std::upper_bound(run.edges.begin(), run.edges.end() - 1, row);
    const auto fold = static_cast<std::size_t>(next - run.edges.begin()) - 1;
    const Filtered filtered(assembly, run.run, segment, filter,
                            offset_terms[offsets[chunk.run] + fold]);
    filtered(chunk.first, chunk.last, std::move(memories[p]),
             [&](std::span<const double* const> columns, std::size_t at, std::size_t count) {
               double* to = out[chunk.run] + segment.first + at * filter.every;
               for (std::size_t i = 0; i < count; ++i) to[i * filter.every] = columns[0][i];
             });
  });
}

/// The columns and the target of all segments of one run, unfiltered but low-passed: column k of
/// row i of them at out[k · stride + i].
inline void rows_of(const ColumnAssembly& assembly, const ScreenedRun& run,
                    const Mixture& offset_terms, double* out, std::size_t stride,
                    StateCache& cache) {
  const Filter plain;
  std::vector<std::size_t> begins;
  for (const Segment& segment : run.segments) begins.push_back(Filtered::begin(segment, plain, 0));
  const auto memories = memories_of(assembly, run.run.channels, run.number, begins, cache, 1);
  for (std::size_t s = 0; s < run.segments.size(); ++s) {
    const Segment& segment = run.segments[s];
    const Filtered filtered(assembly, run.run, segment, plain, offset_terms);
    filtered(0, segment.last - segment.first, memories[s],
             [&](std::span<const double* const> columns, std::size_t at, std::size_t count) {
               for (std::size_t k = 0; k < columns.size(); ++k) {
                 std::copy_n(columns[k], count, out + k * stride + at);
               }
             });
    out += segment.last - segment.first;
  }
}

}  // namespace flexspline::batch
