#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

#include "every_isa.hpp"
#include "host/column_block.hpp"
#include "host/kernels.hpp"
#include "host/trig_gram.hpp"

using namespace flexspline::batch;

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// Columns 1, dense..., cos θ, sin θ, ... by the standard library; then cos θ, sin θ, weights.
ColumnBlock plain_rows(std::size_t dense, std::size_t harmonics, std::size_t samples) {
  std::mt19937_64 generator(7);
  std::normal_distribution<double> normal;
  const std::size_t columns = 1 + dense + 2 * harmonics;
  ColumnBlock block(columns + 3, samples);
  for (std::size_t k = 0; k < samples; ++k) {
    const long double angle = 3.0L * static_cast<long double>(normal(generator));
    block[0][k] = 1.0;
    for (std::size_t i = 0; i < dense; ++i) block[1 + i][k] = normal(generator);
    for (std::size_t m = 1; m <= harmonics; ++m) {
      block[dense + 2 * m - 1][k] =
          static_cast<double>(std::cos(static_cast<long double>(m) * angle));
      block[dense + 2 * m][k] = static_cast<double>(std::sin(static_cast<long double>(m) * angle));
    }
    block[columns][k] = static_cast<double>(std::cos(angle));
    block[columns + 1][k] = static_cast<double>(std::sin(angle));
    block[columns + 2][k] = std::abs(normal(generator));
  }
  return block;
}

void check_equal(const Kernels& with, std::size_t dense, std::size_t harmonics, std::size_t samples,
                 bool weighted) {
  CAPTURE(dense);
  CAPTURE(harmonics);
  CAPTURE(samples);
  CAPTURE(weighted);
  const std::size_t columns = 1 + dense + 2 * harmonics;
  const ColumnBlock block = plain_rows(dense, harmonics, samples);
  const double* const weights = weighted ? block[columns + 2] : nullptr;
  Gram plain(static_cast<int>(columns));
  plain.add(block.columns().first(columns), samples, weights, with);
  TrigSums sums(static_cast<int>(dense), static_cast<int>(harmonics));
  sums.add(block.columns().subspan(1, dense), block[columns], block[columns + 1], samples, weights,
           with);
  const Gram structured = sums.gram();
  REQUIRE(structured.high.size() == plain.high.size());
  for (std::size_t i = 0; i < columns; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      const std::size_t at = i * columns + j;
      // the base angle is rounded (n ε/2 at order n), rotation adds n ε, summing at most N ε;
      // a product of two harmonics stands for orders up to 2n
      const double size =
          std::sqrt(plain.high[i * columns + i] * plain.high[j * columns + j]) + plain.high[0];
      const double bound = epsilon * static_cast<double>(4 * harmonics + samples + 4) * size;
      REQUIRE(std::abs(structured.high[at] - plain.high[at]) <= bound);
    }
  }
}

}  // namespace

TEST_CASE("sums of harmonics give the Gram of the plain rows") {
  for_every_isa([](const Kernels& with) {
    for (const bool weighted : {false, true}) {
      for (const std::size_t samples : {1u, 3u, 4u, 255u, 256u, 1021u}) {
        for (const std::size_t harmonics : {1u, 2u, 3u, 10u}) {
          for (std::size_t dense = 0; dense <= 13; ++dense) {
            check_equal(with, dense, harmonics, samples, weighted);
          }
        }
      }
      check_equal(with, 6, 80, 700, weighted);
    }
  });
}

TEST_CASE("without harmonics only the dense columns are summed") {
  for_every_isa([](const Kernels& with) { check_equal(with, 3, 0, 100, false); });
}

TEST_CASE("sums of harmonics of two blocks are those of the whole") {
  const ColumnBlock block = plain_rows(2, 4, 600);
  const auto add = [&](TrigSums& sums, std::size_t first, std::size_t samples) {
    const double* const dense[] = {block[1] + first, block[2] + first};
    sums.add(dense, block[11] + first, block[12] + first, samples);
  };
  TrigSums whole(2, 4), parts(2, 4), second(2, 4);
  add(whole, 0, 600);
  add(parts, 0, 250);
  add(second, 250, 350);
  parts += second;
  for (std::size_t i = 0; i < whole.sums().size(); ++i) {
    CHECK(parts.sums()[i] == doctest::Approx(whole.sums()[i]).epsilon(600 * epsilon).scale(600));
  }
  parts -= second;
  TrigSums first(2, 4);
  add(first, 0, 250);
  for (std::size_t i = 0; i < whole.sums().size(); ++i) {
    CHECK(parts.sums()[i] == doctest::Approx(first.sums()[i]).epsilon(600 * epsilon).scale(600));
  }
}

TEST_CASE("NaN in an angle or a dense column reaches every sum it belongs to") {
  for_every_isa([](const Kernels& with) {
    const ColumnBlock block = plain_rows(1, 3, 50);
    const double* const dense[] = {block[1]};
    block[1][49] = std::numeric_limits<double>::quiet_NaN();
    TrigSums sums(1, 3);
    sums.add(dense, block[8], block[9], 50, nullptr, with);
    const Gram gram = sums.gram();
    for (int j = 0; j < gram.columns; ++j) CHECK(std::isnan(gram(1, j)));
    CHECK(std::isfinite(gram(0, 2)));
    block[8][0] = std::numeric_limits<double>::quiet_NaN();
    block[9][0] = std::numeric_limits<double>::quiet_NaN();
    TrigSums angles(1, 3);
    angles.add(dense, block[8], block[9], 50, nullptr, with);
    for (int j = 2; j < gram.columns; ++j) CHECK(std::isnan(angles.gram()(0, j)));
  });
}

TEST_CASE("cosine and sine are exact to 2e-16 up to a million radians") {
  for_every_isa([](const Kernels& with) {
    std::mt19937_64 generator(3);
    std::vector<double> angles{0.0, -0.0, 1e-300, 0.7853981633974483, 1.5707963267948966,
                               1e6, -1e6};
    for (const double range : {1.0, 10.0, 1e4, 1e6}) {
      std::uniform_real_distribution<double> uniform(-range, range);
      for (int i = 0; i < 5000; ++i) angles.push_back(uniform(generator));
    }
    for (int k = -4000; k < 4000; ++k) angles.push_back(k * 1.5707963267948966);
    std::vector<double> cosine(angles.size()), sine(angles.size());
    with.cosine_and_sine(angles.data(), angles.size(), cosine.data(), sine.data());
    for (std::size_t i = 0; i < angles.size(); ++i) {
      CAPTURE(angles[i]);
      const long double angle = angles[i];
      REQUIRE(std::abs(static_cast<double>(static_cast<long double>(cosine[i]) - std::cos(angle))) <
              2e-16);
      REQUIRE(std::abs(static_cast<double>(static_cast<long double>(sine[i]) - std::sin(angle))) <
              2e-16);
    }
  });
}

TEST_CASE("an angle without a cosine gives NaN, not a number that looks good") {
  for_every_isa([](const Kernels& with) {
    const double infinity = std::numeric_limits<double>::infinity();
    const double angles[] = {std::numeric_limits<double>::quiet_NaN(), infinity, -infinity, 1e300,
                             2e6};
    double cosine[5], sine[5];
    with.cosine_and_sine(angles, 5, cosine, sine);
    for (int i = 0; i < 5; ++i) {
      CHECK(std::isnan(cosine[i]));
      CHECK(std::isnan(sine[i]));
    }
  });
}
