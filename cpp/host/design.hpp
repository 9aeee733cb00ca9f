/// Effects chosen at run time: their columns for a block of samples, and their sum.
///
/// Effects that remember go through a run row by row: who evaluates chunks of it in another order
/// takes the memory before each chunk from `remember`.
#pragma once

#include <span>
#include <vector>

#include "host/columns.hpp"

namespace flexspline::batch {

/// A model put together at run time.
class Design {
 public:
  Design(std::vector<AnyEffect> effects, const Gear<double>& gear);

  std::size_t columns() const noexcept { return columns_; }
  const std::vector<AnyEffect>& effects() const noexcept { return effects_; }
  const Gear<double>& gear() const noexcept { return gear_; }
  bool remembers() const noexcept { return !remembering_.empty(); }
  static bool remembers(const AnyEffect& any);

  /// The memory at the beginning of a run.
  Memory fresh() const;

  /// The columns of rows [first, first + count), count ≤ SampleBlock::capacity: term k of row
  /// first + i at out[k · stride + i]. The load is the known load plus what `coefficients` (as
  /// many as columns, or none) say of it. `memory` is that before row `first` and becomes that
  /// after the last one.
  void fill(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, Memory& memory, double* out,
            std::size_t stride) const;

  /// The same with a memory that has seen nothing.
  void fill(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, double* out, std::size_t stride) const {
    Memory memory = fresh();
    fill(channels, first, count, coefficients, memory, out, stride);
  }

  /// The memory before each of these rows, from one pass over the log up to the last of them. With
  /// it the rows between can be evaluated in any order, and in parallel, to the same bits.
  std::vector<Memory> remember(const Channels& channels, std::span<const std::size_t> rows,
                               std::span<const double> coefficients) const;

  /// Takes the memory of effects `which`, which have one, from before row `first` to before `last`.
  void advance(const Channels& channels, std::size_t first, std::size_t last,
               std::span<const double> coefficients, Memory& memory,
               std::span<const std::size_t> which) const;

  /// Whether each of the rows [first, first + count) no longer depends on what the memory was
  /// before the first row of its run, which nobody knows.
  void settled(const Channels& channels, std::size_t first, std::size_t count,
               std::span<const double> coefficients, Memory& memory, bool* out) const;

  /// The same without the columns of ones and of one ripple effect, and instead cosine and sine
  /// of its angle: where no other effect reads an angle, straight from the radians.
  void fill_dense(const Channels& channels, std::size_t first, std::size_t count,
                  std::span<const double> coefficients, std::size_t ripple, double* out,
                  std::size_t stride, double* cosine, double* sine) const;

  /// Row · coefficients for rows [first, first + count), summed as Model::predict does.
  void predict(const Channels& channels, std::size_t first, std::size_t count,
               std::span<const double> coefficients, Memory& memory, double* torque) const;

  /// The same with a memory that has seen nothing.
  void predict(const Channels& channels, std::size_t first, std::size_t count,
               std::span<const double> coefficients, double* torque) const {
    Memory memory = fresh();
    predict(channels, first, count, coefficients, memory, torque);
  }

 private:
  static SampleBlock::Angles angles_of(const AnyEffect& any);

  /// The pair of a ripple effect's first harmonic.
  static Pair pair_of(const AnyEffect& any);

  /// Reads a block and makes its load, kept in `load`; `out` serves as scratch.
  void read(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, double* out, std::size_t stride,
            SampleBlock::Angles angles, SampleBlock& block,
            SampleBlock::Column<double>& load) const;

  template <typename Chosen>
  void each(const SampleBlock& block, Memory& memory, double* out, std::size_t stride,
            Chosen chosen) const;

  /// Calls use(stateful, first) for effects `which`, those of one kind that follow each other at
  /// once; `first` is the number of the first of them.
  template <typename Use>
  void by_kind(std::span<const std::size_t> which, Memory& memory, Use use) const;

  /// Takes effects `which`, which have memory, over rows without writing columns: use(i, settled)
  /// for each row of each; settled() says whether the start no longer matters.
  template <typename Use>
  void pass(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, Memory& memory,
            std::span<const std::size_t> which, Use use) const;

  /// Adds the chosen effects' torques to `total`, an effect at a time.
  template <typename Chosen>
  void sum(std::span<const double> coefficients, const double* rows, std::size_t stride,
           std::size_t count, double* total, Chosen chosen) const;

  std::vector<AnyEffect> effects_;
  Gear<double> gear_;
  std::vector<std::size_t> offsets_;      ///< the first column of each effect
  std::vector<std::size_t> remembering_;  ///< numbers of the effects with memory
  std::size_t columns_ = 0;
  SampleBlock::Angles angles_ = SampleBlock::Angles::none;
  std::size_t angle_readers_ = 0;
  bool load_ = false;
};

}  // namespace flexspline::batch
