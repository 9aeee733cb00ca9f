/// Working memory for one block of samples: columns side by side, each on a cache line of its own.
///
/// Kernels take any pointers, but read columns that start at a multiple of 64 bytes about a fifth
/// faster; and columns a multiple of 4096 bytes apart fight for the same places in the cache, so a
/// line is left free between them.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <span>
#include <vector>

namespace flexspline::batch {

class ColumnBlock {
 public:
  ColumnBlock(std::size_t columns, std::size_t samples)
      : samples_(samples), values_(allocate(columns * stride(samples))) {
    for (std::size_t i = 0; i < columns; ++i) {
      writable_.push_back(values_.get() + i * stride(samples));
    }
    columns_.assign(writable_.begin(), writable_.end());
  }

  /// The column to be filled, `samples()` values.
  [[nodiscard]] double* operator[](std::size_t column) const noexcept { return writable_[column]; }
  [[nodiscard]] std::span<const double* const> columns() const noexcept { return columns_; }
  [[nodiscard]] std::size_t samples() const noexcept { return samples_; }

 private:
  static constexpr std::size_t line = 8;  // doubles
  static constexpr std::align_val_t alignment{64};

  struct Free {
    void operator()(double* values) const noexcept { ::operator delete[](values, alignment); }
  };

  static std::size_t stride(std::size_t samples) noexcept {
    return (samples + line - 1) / line * line + line;
  }
  static double* allocate(std::size_t count) {
    return static_cast<double*>(::operator new[](count * sizeof(double), alignment));
  }

  std::size_t samples_;
  std::unique_ptr<double[], Free> values_;
  std::vector<double*> writable_;
  std::vector<const double*> columns_;
};

}  // namespace flexspline::batch
