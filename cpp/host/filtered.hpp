/// Columns of a chunk of a run as the noise sees them: low-passed, thinned, and filtered to white.
///
///   s_c(j) = Σ_k kernel_k · column_c(first + j · every + k − h),    |k − h| ≤ h, symmetric
///   w_c(j) = Σ_i whitening_i · s_c(j − i)
///
/// The target is low-passed already; its offset terms are taken off before it is filtered.
#pragma once

#include <utility>

#include "host/column_assembly.hpp"
#include "host/column_block.hpp"

namespace flexspline::batch {

/// Rows [first, last) of a run without a gap, and the low pass there (empty: none).
struct Segment {
  std::size_t first = 0;
  std::size_t last = 0;
  std::vector<double> kernel;  ///< 2h + 1 weights; rows from first − h to last + h are there

  std::size_t reach() const noexcept { return kernel.size() / 2; }
};

/// One row of `every` counts; `whitening`: [1, −φ₁, …].
struct Filter {
  std::vector<double> whitening{1.0};
  std::size_t every = 1;

  std::size_t order() const noexcept { return whitening.size() - 1; }
};

/// out[j] = Σ_i weight_i · in[j + n − 1 − i] for n weights, four of them at a time.
inline void convolve(std::span<const double> weights, const double* in, std::size_t count,
                     double* out) {
  run_wide([=, a = weights.data(), n = weights.size()] {
    const double* x = in + (n - 1);
    std::size_t i = n % 4;
    for (std::size_t j = 0; j < count; ++j) {
      double sum = i > 0 ? a[0] * x[j] : 0.0;
      if (i > 1) sum += a[1] * (x - 1)[j];
      if (i > 2) sum += a[2] * (x - 2)[j];
      out[j] = sum;
    }
    for (; i < n; i += 4) {
      const double* y = x - i;
      const double a0 = a[i], a1 = a[i + 1], a2 = a[i + 2], a3 = a[i + 3];
      for (std::size_t j = 0; j < count; ++j) {
        out[j] += a0 * y[j] + a1 * (y - 1)[j] + (a2 * (y - 2)[j] + a3 * (y - 3)[j]);
      }
    }
  });
}

/// out[j] = Σ_k kernel_k · in[j · every + k].
inline void smooth(std::span<const double> kernel, const double* in, std::size_t every,
                   std::size_t count, double* out) {
  run_wide([=, a = kernel.data(), n = kernel.size()] {
    for (std::size_t j = 0; j < count; ++j) {
      const double* x = in + j * every;
      double sums[8] = {};
      std::size_t k = 0;
      for (; k + 8 <= n; k += 8) {
        for (std::size_t i = 0; i < 8; ++i) sums[i] += a[k + i] * x[k + i];
      }
      double sum = 0.0;
      for (; k < n; ++k) sum += a[k] * x[k];
      for (const double part : sums) sum += part;
      out[j] = sum;
    }
  });
}

/// Values side by side, of which the last few stay when others come.
class SlidingBuffer {
 public:
  SlidingBuffer(std::size_t columns, std::size_t capacity)
      : columns_(columns), block_(columns, capacity) {}

  double* begin(std::size_t column) const noexcept { return block_[column]; }
  double* end(std::size_t column) const noexcept { return block_[column] + size_; }
  std::size_t size() const noexcept { return size_; }

  void grow(std::size_t count) noexcept {
    size_ += count;
    if (owed_ > 0) drop(std::exchange(owed_, 0));
  }

  /// Forgets the first `count`; those that are still to come as soon as they are there.
  void drop(std::size_t count) noexcept {
    const std::size_t here = std::min(count, size_);
    for (std::size_t k = 0; k < columns_ && here > 0; ++k) {
      std::copy(begin(k) + here, end(k), begin(k));
    }
    size_ -= here;
    owed_ = count - here;
  }

 private:
  std::size_t columns_;
  ColumnBlock block_;
  std::size_t size_ = 0;
  std::size_t owed_ = 0;
};

/// How many rows of so many columns the cache holds at once.
inline std::size_t rows_at_once(std::size_t columns) noexcept {
  constexpr std::size_t numbers = 48 * 1024;
  const std::size_t rows = numbers / std::max<std::size_t>(columns, 1) / 64 * 64;
  return std::clamp<std::size_t>(rows, 256, SampleBlock::capacity);
}

/// Calls use(columns, first, count) for block after block of the filtered columns, target last;
/// `first` counts the rows kept of the segment. Outputs [first, last) of the segment, first at
/// least the filter's order.
class Filtered {
 public:
  Filtered(const ColumnAssembly& assembly, const AssemblyRun& run, const Segment& segment,
           const Filter& filter, const Mixture& offset_terms)
      : assembly_(assembly),
        run_(run),
        segment_(segment),
        filter_(filter),
        offset_terms_(offset_terms),
        width_(assembly.columns.size() + 1),
        block_(rows_at_once(assembly.parts() + 2 * width_)),
        thins_(!segment.kernel.empty() || filter.every > 1) {}

  /// The first row whose columns are needed for outputs from `first` on.
  static std::size_t begin(const Segment& segment, const Filter& filter, std::size_t first) {
    return segment.first + (first - filter.order()) * filter.every - segment.reach();
  }

  /// `memory`: before row begin(segment, filter, first).
  template <typename Use>
  void operator()(std::size_t first, std::size_t last, Memory memory, Use use) const {
    AssembledRows rows(assembly_, run_, offset_terms_, std::move(memory), block_);
    const std::size_t order = filter_.order();
    const std::size_t span = 2 * segment_.reach() + filter_.every;
    SlidingBuffer raw(thins_ ? width_ : 0, block_ + span);
    SlidingBuffer signal(width_, block_ + order + 1);
    const ColumnBlock white(order > 0 ? width_ : 0, block_);
    std::size_t row = begin(segment_, filter_, first);
    std::size_t next = first - order;  // the output whose signal comes next
    while (next < last) {
      const std::size_t left = needed(last, row);
      const std::size_t count = std::min(block_, left);
      std::size_t made = count;
      if (thins_) {
        rows.fill(row, count, [&](std::size_t k) { return raw.end(k); });
        raw.grow(count);
        made = thin(raw, signal, last - next);
      } else {
        rows.fill(row, count, [&](std::size_t k) { return signal.end(k); });
      }
      row += count;
      take_target(signal, next, made);
      signal.grow(made);
      next += made;
      give(signal, white, next, use);
    }
  }

 private:
  /// Rows from `row` on that outputs before `last` need.
  std::size_t needed(std::size_t last, std::size_t row) const noexcept {
    return segment_.first + (last - 1) * filter_.every + segment_.reach() + 1 - row;
  }

  /// Low-passes and thins what has come in; returns how many values that gives.
  std::size_t thin(SlidingBuffer& raw, const SlidingBuffer& signal, std::size_t most) const {
    const std::size_t window = 2 * segment_.reach() + 1;
    if (raw.size() < window) return 0;
    const std::size_t count = std::min((raw.size() - window) / filter_.every + 1, most);
    const double one = 1.0;
    const std::span<const double> kernel =
        segment_.kernel.empty() ? std::span(&one, 1) : std::span<const double>(segment_.kernel);
    for (std::size_t k = 0; k < width_; ++k) {
      smooth(kernel, raw.begin(k), filter_.every, count, signal.end(k));
    }
    raw.drop(count * filter_.every);
    return count;
  }

  /// The last column holds what is taken off the target; it becomes what is left.
  void take_target(const SlidingBuffer& signal, std::size_t next, std::size_t count) const {
    double* column = signal.end(width_ - 1);
    const double* target = run_.target + segment_.first + next * filter_.every;
    for (std::size_t i = 0; i < count; ++i) column[i] = target[i * filter_.every] - column[i];
  }

  template <typename Use>
  void give(SlidingBuffer& signal, const ColumnBlock& white, std::size_t next, Use& use) const {
    const std::size_t order = filter_.order();
    if (signal.size() <= order) return;
    const std::size_t count = signal.size() - order;
    std::vector<const double*> columns;
    for (std::size_t k = 0; k < width_; ++k) {
      if (order > 0) convolve(filter_.whitening, signal.begin(k), count, white[k]);
      columns.push_back(order > 0 ? white[k] : signal.begin(k));
    }
    use(std::span<const double* const>(columns), next - count, count);
    signal.drop(count);
  }

  const ColumnAssembly& assembly_;
  const AssemblyRun& run_;
  const Segment& segment_;
  const Filter& filter_;
  const Mixture& offset_terms_;
  std::size_t width_;
  std::size_t block_;
  bool thins_;
};

}  // namespace flexspline::batch
