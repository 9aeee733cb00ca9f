/// Sums of harmonics as a value, and the Gram made of them.
#include "host/trig_gram.hpp"

#include <memory>
#include <stdexcept>

#include "host/trig_layout.hpp"

namespace flexspline::batch {

namespace {

TrigLayout layout_of(const TrigSums& sums) noexcept {
  return {static_cast<std::size_t>(sums.dense()), static_cast<std::size_t>(sums.harmonics())};
}

void require_alike(const TrigSums& a, const TrigSums& b) {
  if (a.dense() != b.dense() || a.harmonics() != b.harmonics()) {
    throw std::invalid_argument("sums of different harmonics cannot be combined");
  }
}

constexpr std::size_t cache_line = 8;  // doubles

/// The first place in `work` that starts a cache line.
double* on_a_line(std::vector<double>& work) noexcept {
  void* start = work.data();
  std::size_t space = work.size() * sizeof(double);
  return static_cast<double*>(
      std::align(64, (work.size() - cache_line) * sizeof(double), start, space));
}

/// Fills a symmetric matrix by its upper triangle.
struct Filler {
  Gram& gram;

  void set(std::size_t i, std::size_t j, double value) const noexcept {
    const auto n = static_cast<std::size_t>(gram.columns);
    gram.high[i * n + j] = value;
    gram.high[j * n + i] = value;
  }
};

/// C_m and S_m for any m >= 0.
struct Orders {
  const double* sums;
  TrigLayout layout;

  double cosine(std::size_t m) const noexcept {
    return m == 0 ? sums[TrigLayout::weight] : sums[layout.order(m)];
  }
  double sine(std::size_t m) const noexcept { return m == 0 ? 0.0 : sums[layout.order(m) + 1]; }
};

void fill_dense(const double* sums, TrigLayout layout, Filler gram) noexcept {
  gram.set(0, 0, sums[TrigLayout::weight]);
  for (std::size_t i = 0; i < layout.dense; ++i) {
    gram.set(0, 1 + i, sums[TrigLayout::linear + i]);
    for (std::size_t j = i; j < layout.dense; ++j) {
      gram.set(1 + i, 1 + j, sums[layout.products() + i * layout.dense + j]);
    }
  }
}

void fill_cross(const double* sums, TrigLayout layout, Filler gram) noexcept {
  for (std::size_t m = 1; m <= layout.harmonics; ++m) {
    const std::size_t at = layout.dense + 2 * m - 1;  // column of cos mθ
    gram.set(0, at, sums[layout.order(m)]);
    gram.set(0, at + 1, sums[layout.order(m) + 1]);
    for (std::size_t i = 0; i < layout.dense; ++i) {
      gram.set(1 + i, at, sums[layout.cross(i, m)]);
      gram.set(1 + i, at + 1, sums[layout.cross(i, m) + 1]);
    }
  }
}

void fill_harmonics(const Orders& orders, Filler gram) noexcept {
  for (std::size_t a = 1; a <= orders.layout.harmonics; ++a) {
    for (std::size_t b = a; b <= orders.layout.harmonics; ++b) {
      const std::size_t row = orders.layout.dense + 2 * a - 1;
      const std::size_t column = orders.layout.dense + 2 * b - 1;
      const double cosine_difference = orders.cosine(b - a);
      const double cosine_sum = orders.cosine(a + b);
      const double sine_difference = orders.sine(b - a);
      const double sine_sum = orders.sine(a + b);
      gram.set(row, column, 0.5 * (cosine_difference + cosine_sum));
      gram.set(row + 1, column + 1, 0.5 * (cosine_difference - cosine_sum));
      gram.set(row, column + 1, 0.5 * (sine_sum + sine_difference));
      gram.set(row + 1, column, 0.5 * (sine_sum - sine_difference));
    }
  }
}

}  // namespace

TrigSums::TrigSums(int dense, int harmonics) : dense_(dense), harmonics_(harmonics) {
  sums_.resize(layout_of(*this).size());
  work_.resize(layout_of(*this).work() + cache_line);
}

void TrigSums::add(std::span<const double* const> dense_columns, const double* cosine,
                   const double* sine, std::size_t samples, const double* weights,
                   const Kernels& with) {
  if (dense_columns.size() != static_cast<std::size_t>(dense_)) {
    throw std::invalid_argument("a block has another number of columns than its sums");
  }
  with.trig_sums(dense_columns.data(), dense_, cosine, sine, samples, weights, harmonics_,
                 sums_.data(), on_a_line(work_));
}

TrigSums& TrigSums::operator+=(const TrigSums& other) {
  require_alike(*this, other);
  for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] += other.sums_[i];
  return *this;
}

TrigSums& TrigSums::operator-=(const TrigSums& other) {
  require_alike(*this, other);
  for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] -= other.sums_[i];
  return *this;
}

Gram TrigSums::gram() const {
  Gram result(columns());
  const TrigLayout layout = layout_of(*this);
  fill_dense(sums_.data(), layout, {result});
  fill_cross(sums_.data(), layout, {result});
  fill_harmonics({sums_.data(), layout}, {result});
  return result;
}

}  // namespace flexspline::batch
