#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "host/column_block.hpp"
#include "host/gram.hpp"
#include "host/solve.hpp"

using namespace flexspline::batch;

namespace {

__extension__ typedef __float128 Quad;

/// Offset, viscous and harmonics 1..n of an angle within ±range; target with noise of size one.
ColumnBlock partial_turn(std::size_t harmonics, double range, std::size_t samples) {
  std::mt19937_64 generator(11);
  std::normal_distribution<double> normal;
  const std::size_t columns = 2 + 2 * harmonics;
  ColumnBlock block(columns + 1, samples);
  for (std::size_t k = 0; k < samples; ++k) {
    const double phase = 0.01 * static_cast<double>(k);
    const double angle = range * std::sin(phase);
    block[0][k] = 1.0;
    block[1][k] = 1e-3 * std::cos(phase);
    double target = 10.0 + normal(generator);
    for (std::size_t m = 1; m <= harmonics; ++m) {
      block[2 * m][k] = std::cos(static_cast<double>(m) * angle);
      block[2 * m + 1][k] = std::sin(static_cast<double>(m) * angle);
      target += block[2 * m][k] - 2.0 * block[2 * m + 1][k];
    }
    block[columns][k] = target;
  }
  return block;
}

/// The same least squares in 113 bits: sums, elimination with exchange of the largest pivot.
std::vector<Quad> reference(const ColumnBlock& block) {
  const std::size_t p = block.columns().size() - 1;
  std::vector<std::vector<Quad>> a(p, std::vector<Quad>(p + 1));
  for (std::size_t i = 0; i < p; ++i) {
    for (std::size_t j = 0; j <= p; ++j) {
      for (std::size_t k = 0; k < block.samples(); ++k)
        a[i][j] += Quad(block[i][k]) * Quad(block[j][k]);
    }
  }
  for (std::size_t k = 0; k < p; ++k) {
    for (std::size_t i = k + 1; i < p; ++i) {
      const Quad ratio = a[i][k] / a[k][k];
      for (std::size_t j = k; j <= p; ++j) a[i][j] -= ratio * a[k][j];
    }
  }
  std::vector<Quad> b(p);
  for (std::size_t i = p; i-- > 0;) {
    Quad sum = a[i][p];
    for (std::size_t j = i + 1; j < p; ++j) sum -= a[i][j] * b[j];
    b[i] = sum / a[i][i];
  }
  return b;
}

/// |error| / |coefficients|, both as the largest entry.
double error_of(const Solution& solution, const std::vector<Quad>& truth) {
  double error = 0;
  double size = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    error =
        std::max(error, std::abs(static_cast<double>(Quad(solution.coefficients[i]) - truth[i])));
    size = std::max(size, std::abs(static_cast<double>(truth[i])));
  }
  return error / size;
}

/// The worst relative error of a single coefficient.
double worst_of(const Solution& solution, const std::vector<Quad>& truth) {
  double worst = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Quad error = (Quad(solution.coefficients[i]) - truth[i]) / truth[i];
    worst = std::max(worst, std::abs(static_cast<double>(error)));
  }
  return worst;
}

Gram sums_of(const ColumnBlock& block, Precision precision) {
  Gram gram(static_cast<int>(block.columns().size()), precision);
  gram.add(block.columns(), block.samples());
  return gram;
}

Gram small_gram(std::initializer_list<double> values, int columns) {
  Gram gram(columns);
  std::copy(values.begin(), values.end(), gram.high.begin());
  return gram;
}

}  // namespace

TEST_CASE("coefficients keep the promised digits up to a condition number of 1e10") {
  struct Step {
    std::size_t harmonics;
    double range;
    double low, high;  ///< the condition number lies between
    double promised;
  };
  const Step ladder[] = {{3, 3.0, 1, 1e2, 1e-14},    {4, 1.5, 1e2, 1e4, 1e-12},
                         {6, 1.5, 1e3, 1e6, 1e-12},  {10, 1.5, 1e7, 1e9, 1e-8},
                         {4, 0.3, 1e7, 1e9, 1e-8},   {12, 1.5, 1e8, 1e10, 1e-6},
                         {5, 0.35, 1e10, 5e10, 1e-6}};
  for (const Step& step : ladder) {
    const ColumnBlock block = partial_turn(step.harmonics, step.range, 4000);
    const Solution solution = solve(sums_of(block, Precision::double_double));
    const std::vector<Quad> truth = reference(block);
    MESSAGE("condition ", solution.condition, ": error ", error_of(solution, truth),
            ", worst coefficient ", worst_of(solution, truth));
    CHECK(solution.rank == solution.columns);
    CHECK(solution.condition > step.low);
    CHECK(solution.condition < step.high);
    CHECK(worst_of(solution, truth) <= step.promised);
    CHECK(solution.residual_squares == doctest::Approx(4000).epsilon(0.1));
  }
}

TEST_CASE("plain sums are used only where they are good to 1e-9") {
  int accepted = 0;
  for (const std::size_t harmonics : {1u, 2u, 3u, 4u, 6u, 8u}) {
    for (const double range : {0.5, 1.0, 1.5, 2.0, 3.0}) {
      const ColumnBlock block = partial_turn(harmonics, range, 2000);
      const Solution solution = solve(sums_of(block, Precision::plain));
      if (!double_is_enough(solution)) continue;
      ++accepted;
      CHECK(error_of(solution, reference(block)) <= 1e-9);
    }
  }
  CHECK(accepted >= 5);
  const ColumnBlock hard = partial_turn(10, 1.5, 2000);
  CHECK_FALSE(double_is_enough(solve(sums_of(hard, Precision::plain))));
}

TEST_CASE("a column made of two others is dependent, named by its combination and still predicts") {
  ColumnBlock block = partial_turn(2, 3.0, 500);
  for (std::size_t k = 0; k < 500; ++k) block[3][k] = 4.0 * block[1][k] - 0.5 * block[2][k];
  for (const Precision precision : {Precision::plain, Precision::double_double}) {
    const Solution solution = solve(sums_of(block, precision));
    REQUIRE(solution.columns == 6);
    REQUIRE(solution.rank == 5);
    const int dependent = solution.order[5];
    CHECK(solution.coefficients[static_cast<std::size_t>(dependent)] == 0.0);
    double residual = 0;
    double combination = 0;
    for (std::size_t k = 0; k < 500; ++k) {
      double predicted = 0;
      double made = 0;
      for (std::size_t i = 0; i < 6; ++i) predicted += solution.coefficients[i] * block[i][k];
      for (std::size_t i = 0; i < 5; ++i) {
        made += solution.dependence[i] * block[static_cast<std::size_t>(solution.order[i])][k];
      }
      residual += (predicted - block[6][k]) * (predicted - block[6][k]);
      combination =
          std::max(combination, std::abs(made - block[static_cast<std::size_t>(dependent)][k]));
    }
    CHECK(combination < 1e-9);
    CHECK(residual == doctest::Approx(solution.residual_squares).epsilon(1e-9));
    CHECK_FALSE(double_is_enough(solution));
  }
}

TEST_CASE("the factor and the rotated target are those of the columns in their own order") {
  const ColumnBlock block = partial_turn(3, 2.0, 300);
  const Gram gram = sums_of(block, Precision::plain);
  const Solution s = solve(gram);
  const auto p = static_cast<std::size_t>(s.columns);
  for (std::size_t i = 0; i < p; ++i) {
    double target = 0;
    for (std::size_t k = 0; k < p; ++k) target += s.factor[k * p + i] * s.rotated_target[k];
    const double own = gram(static_cast<int>(i), static_cast<int>(i));
    CHECK(std::abs(target - gram(static_cast<int>(i), s.columns)) <=
          1e-14 * std::sqrt(own * gram(s.columns, s.columns)));
    for (std::size_t j = 0; j < p; ++j) {
      double product = 0;
      for (std::size_t k = 0; k < p; ++k) product += s.factor[k * p + i] * s.factor[k * p + j];
      const double size = std::sqrt(own * gram(static_cast<int>(j), static_cast<int>(j)));
      CHECK(std::abs(product - gram(static_cast<int>(i), static_cast<int>(j))) <= 1e-14 * size);
    }
  }
}

TEST_CASE("the condition number of two columns is that of the angle between them") {
  for (const double cosine : {0.0, 0.5, -0.999, 0.99999999}) {
    // correlation c: singular values squared 1 + |c| and 1 - |c|, whatever the lengths
    const double a = 3e-5, b = 7e4;
    const Solution s =
        solve(small_gram({a * a, cosine * a * b, 0, cosine * a * b, b * b, 0, 0, 0, 1}, 3));
    const double c = std::abs(cosine);
    CHECK(s.condition == doctest::Approx(std::sqrt((1 + c) / (1 - c))).epsilon(1e-6));
  }
}

TEST_CASE("a column of zeros is dependent and the others are solved") {
  const Solution s = solve(small_gram({0, 0, 0, 0, 4, 8, 0, 8, 17}, 3));
  CHECK(s.rank == 1);
  CHECK(s.coefficients[0] == 0.0);
  CHECK(s.coefficients[1] == 2.0);
  CHECK(s.residual_squares == 1.0);
}

TEST_CASE("a target alone leaves all of itself") {
  const Solution s = solve(small_gram({5}, 1));
  CHECK(s.rank == 0);
  CHECK(s.residual_squares == 5.0);
}

TEST_CASE("sums that are not finite are refused with their column") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH_AS((void)solve(small_gram({1, 0, 0, nan}, 2)),
                       "the sums of products of column 1 are not finite", std::invalid_argument);
  CHECK_THROWS_AS((void)solve(Gram(0)), std::invalid_argument);
}
