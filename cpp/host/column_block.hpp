/// Working memory for one block of samples: columns side by side, each starting a cache line.
///
/// Kernels take any pointers, but columns that start at a multiple of 64 bytes were measured about
/// a tenth faster than such at 16 (loads of 32 bytes then never cross a line).
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
    return (samples + line - 1) / line * line;
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
