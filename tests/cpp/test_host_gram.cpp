#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "every_isa.hpp"
#include "host/column_block.hpp"
#include "host/gram.hpp"
#include "host/kernels.hpp"

using namespace flexspline::batch;

namespace {

__extension__ typedef __float128 Quad;

constexpr double epsilon = std::numeric_limits<double>::epsilon();

ColumnBlock random_block(std::size_t columns, std::size_t samples) {
  std::mt19937_64 generator(20240607);
  std::normal_distribution<double> normal;
  ColumnBlock block(columns, samples);
  for (std::size_t i = 0; i < columns; ++i) {
    for (std::size_t k = 0; k < samples; ++k)
      block[i][k] = normal(generator) * std::exp(normal(generator));
  }
  return block;
}

struct Sum {
  Quad value = 0;
  double size = 0;  ///< Σ |w x y|
};

Sum reference(const double* x, const double* y, const double* weights, std::size_t samples) {
  Sum sum;
  for (std::size_t k = 0; k < samples; ++k) {
    const Quad term = Quad(x[k]) * Quad(y[k]) * Quad(weights != nullptr ? weights[k] : 1.0);
    sum.value += term;
    sum.size += std::abs(static_cast<double>(term));
  }
  return sum;
}

constexpr std::size_t sizes[] = {0, 1, 2, 3, 5, 8, 17, 511, 513, 1030};

}  // namespace

TEST_CASE("the kernels of every instruction set sum products as a plain loop does") {
  for_every_isa([](const Kernels& with) {
    for (const std::size_t samples : sizes) {
      for (int columns = 1; columns <= 13; ++columns) {
        const ColumnBlock block = random_block(static_cast<std::size_t>(columns) + 1, samples);
        const auto x = block.columns().first(static_cast<std::size_t>(columns));
        std::vector<double> weights(samples);
        for (std::size_t k = 0; k < samples; ++k) weights[k] = std::abs(block[0][k]);
        for (const double* w :
             {static_cast<const double*>(nullptr), static_cast<const double*>(weights.data())}) {
          Gram gram(columns);
          gram.add(x, samples, w, with);
          for (int i = 0; i < columns; ++i) {
            for (int j = 0; j < columns; ++j) {
              const Sum sum = reference(x[static_cast<std::size_t>(i)],
                                        x[static_cast<std::size_t>(j)], w, samples);
              // each of n terms is rounded at most n + 2 times, in units of ε / 2
              const double bound = 0.5 * epsilon * static_cast<double>(samples + 2) * sum.size;
              REQUIRE(std::abs(static_cast<double>(Quad(gram(i, j)) - sum.value)) <= bound);
            }
          }
        }
      }
    }
  });
}

TEST_CASE("double-double sums keep thirty digits of the sum of sizes") {
  for_every_isa([](const Kernels& with) {
    for (const std::size_t samples : sizes) {
      for (const int columns : {1, 2, 3, 5}) {
        const ColumnBlock block = random_block(static_cast<std::size_t>(columns), samples);
        Gram gram(columns, Precision::double_double);
        gram.add(block.columns(), samples, nullptr, with);
        for (int i = 0; i < columns; ++i) {
          for (int j = 0; j < columns; ++j) {
            const Sum sum = reference(block[static_cast<std::size_t>(i)],
                                      block[static_cast<std::size_t>(j)], nullptr, samples);
            const std::size_t at = static_cast<std::size_t>(i * columns + j);
            const Quad error = Quad(gram.high[at]) + Quad(gram.low[at]) - sum.value;
            // 256 terms in the low part of a lane, each rounded to 2⁻¹⁰⁵ of the partial sum
            REQUIRE(std::abs(static_cast<double>(error)) <= 256 * 0x1p-105 * sum.size);
          }
        }
      }
    }
  });
}

TEST_CASE("products that cancel in double survive in double-double") {
  for_every_isa([](const Kernels& with) {
    ColumnBlock block(2, 3);
    const double x[] = {1e8, 1.0, -1e8};
    const double y[] = {1e8 + 1, 1e-9, 1e8 + 1};
    for (std::size_t k = 0; k < 3; ++k) {
      block[0][k] = x[k];
      block[1][k] = y[k];
    }
    Gram gram(2, Precision::double_double);
    gram.add(block.columns(), 3, nullptr, with);
    CHECK(gram(0, 1) == doctest::Approx(1e-9).epsilon(1e-14));
  });
}

TEST_CASE("NaN and infinity are not hidden by the sums") {
  for_every_isa([](const Kernels& with) {
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      for (const std::size_t at : {std::size_t{0}, std::size_t{36}}) {
        for (const Precision precision : {Precision::plain, Precision::double_double}) {
          const ColumnBlock block = random_block(3, 37);
          block[1][at] = bad;
          Gram gram(3, precision);
          gram.add(block.columns(), 37, nullptr, with);
          CHECK(std::isfinite(gram(0, 2)));
          for (const int other : {0, 1, 2}) {
            const double low =
                gram.low.empty() ? 0.0 : gram.low[static_cast<std::size_t>(3 + other)];
            CHECK_FALSE(std::isfinite(gram(1, other) + low));
          }
        }
      }
    }
  });
}

TEST_CASE("blocks merged are the whole and a block taken off leaves the rest") {
  const ColumnBlock block = random_block(4, 1000);
  std::vector<const double*> tail;
  for (const double* column : block.columns()) tail.push_back(column + 300);
  for (const Precision precision : {Precision::plain, Precision::double_double}) {
    const double digits = precision == Precision::plain ? 1000 * epsilon : 1000 * 0x1p-104;
    Gram whole(4, precision), first(4, precision), second(4, precision);
    whole.add(block.columns(), 1000);
    first.add(block.columns(), 300);
    second.add(tail, 700);
    first += second;
    Gram rest = whole;
    rest -= first;
    for (std::size_t i = 0; i < 16; ++i) {
      const double low = rest.low.empty() ? 0.0 : rest.low[i];
      const double size = std::sqrt(whole.high[i / 4 * 5] * whole.high[i % 4 * 5]);
      CHECK(std::abs(rest.high[i] + low) <= digits * size);
    }
  }
}

TEST_CASE("the sums of chosen columns are those of the columns in that order") {
  const ColumnBlock block = random_block(4, 50);
  Gram all(4), two(2);
  all.add(block.columns(), 50);
  const double* const chosen[] = {block[3], block[1]};
  two.add(chosen, 50);
  const int order[] = {3, 1};
  const Gram selected = all.select(order);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(selected.high[i] == doctest::Approx(two.high[i]).epsilon(1e-13));
  }
  const int outside[] = {4};
  CHECK_THROWS_AS((void)all.select(outside), std::invalid_argument);
}

TEST_CASE("sums refuse a block or other sums with another number of columns") {
  const ColumnBlock block = random_block(3, 10);
  Gram gram(2), exact(3, Precision::double_double);
  CHECK_THROWS_AS(gram.add(block.columns(), 10), std::invalid_argument);
  CHECK_THROWS_AS(exact.add(block.columns(), 10, block[0]), std::invalid_argument);
  CHECK_THROWS_AS(gram += exact, std::invalid_argument);
}
