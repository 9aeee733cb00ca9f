/// The Gram as a value.
#include "host/gram.hpp"

#include <stdexcept>

#include "host/double_double.hpp"

namespace flexspline::batch {

namespace {

std::size_t square(int columns) {
  return static_cast<std::size_t>(columns) * static_cast<std::size_t>(columns);
}

/// The kernels sum the upper triangle; the lower one is its mirror.
void mirror(std::vector<double>& values, int columns) noexcept {
  const auto n = static_cast<std::size_t>(columns);
  if (values.empty()) return;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < i; ++j) values[i * n + j] = values[j * n + i];
  }
}

void combine(Gram& sum, const Gram& other, double sign) {
  if (sum.columns != other.columns) {
    throw std::invalid_argument("sums of products of different columns cannot be combined");
  }
  if (other.precision() == Precision::plain) sum.low.clear();
  for (std::size_t i = 0; i < sum.high.size(); ++i) {
    if (sum.low.empty()) {
      sum.high[i] += sign * other.high[i];
    } else {
      const DoubleDouble total = DoubleDouble{sum.high[i], sum.low[i]} +
                                 DoubleDouble{sign * other.high[i], sign * other.low[i]};
      sum.high[i] = total.high;
      sum.low[i] = total.low;
    }
  }
}

}  // namespace

Gram::Gram(int columns_, Precision precision)
    : columns(columns_),
      high(square(columns_)),
      low(precision == Precision::double_double ? square(columns_) : 0) {}

Precision Gram::precision() const noexcept {
  return low.empty() ? Precision::plain : Precision::double_double;
}

double Gram::operator()(int row, int column) const noexcept {
  return high[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
              static_cast<std::size_t>(column)];
}

void Gram::add(std::span<const double* const> columns_of_block, std::size_t samples,
               const double* weights, const Kernels& with) {
  if (columns_of_block.size() != static_cast<std::size_t>(columns)) {
    throw std::invalid_argument("a block has another number of columns than its sums");
  }
  if (precision() == Precision::plain) {
    with.gram(columns_of_block.data(), columns, samples, weights, high.data());
  } else if (weights == nullptr) {
    with.gram_double_double(columns_of_block.data(), columns, samples, high.data(), low.data());
  } else {
    throw std::invalid_argument(
        "weights are for plain sums; scale the columns by their square roots instead");
  }
  mirror(high, columns);
  mirror(low, columns);
}

Gram& Gram::operator+=(const Gram& other) {
  combine(*this, other, 1.0);
  return *this;
}

Gram& Gram::operator-=(const Gram& other) {
  combine(*this, other, -1.0);
  return *this;
}

Gram Gram::select(std::span<const int> chosen) const {
  Gram result(static_cast<int>(chosen.size()), precision());
  const auto n = static_cast<std::size_t>(columns);
  std::size_t to = 0;
  for (const int i : chosen) {
    for (const int j : chosen) {
      const std::size_t from = static_cast<std::size_t>(i) * n + static_cast<std::size_t>(j);
      if (i < 0 || j < 0 || i >= columns || j >= columns) {
        throw std::invalid_argument("a chosen column is not among the sums");
      }
      result.high[to] = high[from];
      if (!low.empty()) result.low[to] = low[from];
      ++to;
    }
  }
  return result;
}

}  // namespace flexspline::batch
