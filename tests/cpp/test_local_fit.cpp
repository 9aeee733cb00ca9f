#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <vector>

#include "host/local_fit.hpp"

using namespace flexspline::batch;

namespace {

/// Times with uneven steps.
std::vector<double> times() {
  std::vector<double> t;
  for (int k = 0; k < 12; ++k) t.push_back(0.01 * k + 0.003 * std::sin(5.0 * k));
  return t;
}

double applied(const std::vector<double>& time, const LocalWindow& window, std::size_t degree,
               std::size_t derivative, const std::vector<double>& values) {
  std::vector<double> weights(window.last - window.first);
  local_weights(time, window, degree, derivative, weights.data());
  double sum = 0.0;
  for (std::size_t k = 0; k < weights.size(); ++k) sum += weights[k] * values[window.first + k];
  return sum;
}

}  // namespace

TEST_CASE("a polynomial of the degree that is fitted comes out as it is, with its derivatives") {
  const auto time = times();
  for (const LocalWindow window :
       {LocalWindow{5, 0, 12, 0.03}, LocalWindow{0, 0, 6, 0.02}, LocalWindow{11, 5, 12, 0.02}}) {
    for (std::size_t degree = 0; degree <= most_degree; ++degree) {
      std::vector<double> values;
      for (const double t : time) {
        values.push_back(2.0 + std::pow(30.0 * t, static_cast<double>(degree)));
      }
      const double at = time[window.row];
      const auto n = static_cast<double>(degree);
      CHECK(applied(time, window, degree, 0, values) ==
            doctest::Approx(2.0 + std::pow(30.0 * at, n)).epsilon(1e-10));
      if (degree >= 1) {
        CHECK(applied(time, window, degree, 1, values) ==
              doctest::Approx(n * 30.0 * std::pow(30.0 * at, n - 1.0)).epsilon(1e-8));
      }
      if (degree >= 2) {
        CHECK(applied(time, window, degree, 2, values) ==
              doctest::Approx(n * (n - 1.0) * 900.0 * std::pow(30.0 * at, n - 2.0)).epsilon(1e-6));
      }
    }
  }
}

TEST_CASE("a row counts less the farther it is") {
  const auto time = times();
  const LocalWindow window{5, 0, 12, 0.02};
  std::vector<double> weights(12);
  local_weights(time, window, 0, 0, weights.data());
  for (std::size_t k = 0; k < 12; ++k) {
    for (std::size_t j = 0; j < 12; ++j) {
      if (std::abs(time[k] - time[5]) < std::abs(time[j] - time[5])) {
        CHECK(weights[k] > weights[j]);
      }
    }
  }
}

TEST_CASE("a window without enough rows for its polynomial gives nothing that is finite") {
  const auto time = times();
  std::array<double, 2> weights{};
  local_weights(time, {5, 5, 6, 0.02}, 1, 1, weights.data());
  CHECK_FALSE(std::isfinite(weights[0]));
}
