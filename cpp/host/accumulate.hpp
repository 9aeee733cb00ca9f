/// One pass over a log: the Gram of [X y] for each block of rows.
///
/// Where the design has one ripple effect with dense orders 1…n, the sums of products of
/// harmonics are taken from sums of harmonics (trig_gram.hpp); everything else, and whatever is
/// asked for in double-double, goes through the plain columns. Both give the same Gram but for
/// rounding; a test holds them together.
#pragma once

#include <cmath>
#include <optional>

#include "host/column_block.hpp"
#include "host/design.hpp"
#include "host/gram.hpp"
#include "host/parallel.hpp"
#include "host/trig_gram.hpp"

namespace flexspline::batch {

/// Rows [first, last) of a log.
struct Rows {
  std::size_t first = 0;
  std::size_t last = 0;
};

/// What is summed: columns of a design over a log, the target, and perhaps a weight per row.
struct Problem {
  const Design& design;
  const Channels& channels;
  const double* target;                  ///< y, in the target's unit
  const double* weights;                 ///< null: all one
  std::span<const double> coefficients;  ///< for the load; empty: known load alone
  std::span<const double> offset_terms;  ///< taken off the target: y − row · these; empty: nothing
};

/// Where the columns of a design stand for the structured sums.
struct Structure {
  std::size_t ripple = 0;          ///< which effect is the dense ripple
  std::vector<std::size_t> dense;  ///< columns that are neither ripple nor ones
  std::vector<int> order;          ///< column of the design -> column of TrigSums, target last
  int harmonics = 0;
  /// The column that is one minus the column before it (the two directions of Coulomb friction
  /// add up to one), so that its sums need no pass; 0: there is none.
  std::size_t complement = 0;
};

/// Whether an effect is a ripple with orders 1, 2, … n, n ≥ 4, of one pair.
inline bool is_dense_ripple(const AnyEffect& any) {
  return std::visit(
      []<typename Effect>(const Effect& effect) {
        if constexpr (HarmonicEffect<Effect> && !ModulatedHarmonicEffect<Effect>) {
          const auto harmonics = effect.harmonics();
          for (std::size_t k = 0; k < harmonics.size(); ++k) {
            if (harmonics[k].order != k + 1) return false;
            if (harmonics[k].pair != harmonics[0].pair) return false;
          }
          return harmonics.size() >= 4;
        }
        return false;
      },
      any);
}

/// The structure of a design, if it has one that pays: a dense ripple, and no memory.
inline std::optional<Structure> structure_of(const Design& design) {
  if (design.remembers()) return std::nullopt;
  const auto& effects = design.effects();
  const auto found = std::find_if(effects.begin(), effects.end(), is_dense_ripple);
  if (found == effects.end()) return std::nullopt;

  Structure structure;
  structure.ripple = static_cast<std::size_t>(found - effects.begin());
  structure.harmonics = static_cast<int>(terms_of(*found) / 2);
  int dense = 1;  // the column of ones comes first
  std::vector<std::size_t> ripple_at;
  const auto place = [&](const AnyEffect& effect, std::size_t column, bool second) {
    if (&effect == &*found) {
      ripple_at.push_back(column);
      return 0;
    }
    if (std::holds_alternative<Offset<double>>(effect)) return 0;
    if (std::holds_alternative<CoulombFrictionPerDirection<double>>(effect) && second) {
      structure.complement = column;
      return 0;
    }
    structure.dense.push_back(column);
    return dense++;
  };
  for (const AnyEffect& effect : effects) {
    for (std::size_t k = 0; k < terms_of(effect); ++k) {
      structure.order.push_back(place(effect, structure.order.size(), k == 1));
    }
  }
  const int target = dense++;
  for (const std::size_t at : ripple_at) structure.order[at] = dense++;
  structure.order.push_back(target);
  return structure;
}

/// Columns of a design for one chunk of a log after another, with the target behind them.
class Columns {
 public:
  /// `memory`: before the first chunk.
  Columns(const Problem& problem, Memory memory)
      : problem_(problem),
        block_(problem.design.columns() + 1, SampleBlock::capacity),
        memory_(std::move(memory)) {}

  void fill(std::size_t first, std::size_t count) {
    problem_.design.fill(problem_.channels, first, count, problem_.coefficients, memory_, block_[0],
                         SampleBlock::capacity);
    double* target = block_[problem_.design.columns()];
    std::copy_n(problem_.target + first, count, target);
    for (std::size_t k = 0; k < problem_.offset_terms.size(); ++k) {
      if (problem_.offset_terms[k] == 0.0) continue;
      for (std::size_t i = 0; i < count; ++i) target[i] -= problem_.offset_terms[k] * block_[k][i];
    }
  }

  /// Multiplies every column by the square roots of the weights.
  void scale(const double* weights, std::size_t count) {
    for (std::size_t k = 0; k <= problem_.design.columns(); ++k) {
      for (std::size_t i = 0; i < count; ++i) block_[k][i] *= std::sqrt(weights[i]);
    }
  }
  std::span<const double* const> pointers() const { return block_.columns(); }

 private:
  const Problem& problem_;
  ColumnBlock block_;
  Memory memory_;
};

/// Calls chunk(first, count) for rows in chunks that fit a SampleBlock.
template <typename Chunk>
void in_chunks(const Rows& rows, Chunk&& chunk) {
  for (std::size_t first = rows.first; first < rows.last; first += SampleBlock::capacity) {
    chunk(first, std::min(SampleBlock::capacity, rows.last - first));
  }
}

/// The Gram of one block of rows through plain columns; `memory` is that before the block.
inline Gram plain_gram(const Problem& problem, const Rows& rows, Precision precision,
                       const Memory& memory) {
  Columns columns(problem, memory);
  Gram gram(static_cast<int>(problem.design.columns()) + 1, precision);
  in_chunks(rows, [&](std::size_t first, std::size_t count) {
    columns.fill(first, count);
    const double* weights = problem.weights != nullptr ? problem.weights + first : nullptr;
    if (weights != nullptr && precision == Precision::double_double) {
      columns.scale(weights, count);
      weights = nullptr;
    }
    gram.add(columns.pointers(), count, weights);
  });
  return gram;
}

/// Turns the column of ones at `complement` into ones minus the column before it.
inline void complete(Gram& gram, std::size_t complement) {
  const auto size = static_cast<std::size_t>(gram.columns);
  double* values = gram.high.data();
  for (std::size_t x = 0; x < size; ++x) {
    values[complement * size + x] -= values[(complement - 1) * size + x];
  }
  for (std::size_t x = 0; x < size; ++x) {
    values[x * size + complement] -= values[x * size + complement - 1];
  }
}

/// The Gram of one block of rows through sums of harmonics.
inline Gram structured_gram(const Problem& problem, const Structure& structure, const Rows& rows) {
  const ColumnBlock block(problem.design.columns(), SampleBlock::capacity);
  std::vector<const double*> dense;
  for (const std::size_t k : structure.dense) dense.push_back(block[k]);
  dense.push_back(nullptr);
  SampleBlock::Column<double> cosine;
  SampleBlock::Column<double> sine;
  TrigSums sums(static_cast<int>(dense.size()), structure.harmonics);
  in_chunks(rows, [&](std::size_t first, std::size_t count) {
    problem.design.fill_dense(problem.channels, first, count, problem.coefficients,
                              structure.ripple, block[0], SampleBlock::capacity, cosine.data(),
                              sine.data());
    dense.back() = problem.target + first;
    const double* weights = problem.weights != nullptr ? problem.weights + first : nullptr;
    sums.add(dense, cosine.data(), sine.data(), count, weights);
  });
  Gram gram = sums.gram().select(structure.order);
  if (structure.complement != 0) complete(gram, structure.complement);
  return gram;
}

/// The Gram of each block. `structured` false forces the plain columns.
inline std::vector<Gram> accumulate(const Problem& problem, std::span<const Rows> blocks,
                                    Precision precision, bool structured, int threads) {
  const auto structure = structured && precision == Precision::plain && problem.offset_terms.empty()
                             ? structure_of(problem.design)
                             : std::optional<Structure>{};
  std::vector<std::size_t> firsts;
  for (const Rows& block : blocks) firsts.push_back(block.first);
  const auto memories = problem.design.remember(problem.channels, firsts, problem.coefficients);
  std::vector<Gram> grams(blocks.size());
  parallel_blocks(blocks.size(), threads, [&](std::size_t b) {
    grams[b] = structure ? structured_gram(problem, *structure, blocks[b])
                         : plain_gram(problem, blocks[b], precision, memories[b]);
  });
  return grams;
}

/// The Gram of each block from explicit rows: column k of row i at rows[k · stride + i]; the last
/// column is the target. For rows that were filtered, which no formula gives.
inline std::vector<Gram> accumulate_rows(std::span<const double* const> columns,
                                         const double* weights, std::span<const Rows> blocks,
                                         Precision precision, int threads) {
  std::vector<Gram> grams(blocks.size());
  parallel_blocks(blocks.size(), threads, [&](std::size_t b) {
    Gram gram(static_cast<int>(columns.size()), precision);
    in_chunks(blocks[b], [&](std::size_t first, std::size_t count) {
      std::vector<const double*> chunk(columns.begin(), columns.end());
      for (const double*& column : chunk) column += first;
      gram.add(chunk, count, weights != nullptr ? weights + first : nullptr);
    });
    grams[b] = std::move(gram);
  });
  return grams;
}

}  // namespace flexspline::batch
