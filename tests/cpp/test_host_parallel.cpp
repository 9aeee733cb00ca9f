#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "host/gram.hpp"
#include "host/kernels.hpp"
#include "host/parallel.hpp"
#include "host/wide_loop.hpp"

using namespace flexspline::batch;

TEST_CASE("sums merged in the order of their blocks do not depend on the number of threads") {
  std::vector<double> x(10007), y(10007);
  for (std::size_t k = 0; k < x.size(); ++k) {
    x[k] = std::sin(0.1 * static_cast<double>(k));
    y[k] = std::sqrt(static_cast<double>(k));
  }
  const auto total = [&](int threads) {
    constexpr std::size_t length = 500;
    const std::size_t blocks = (x.size() + length - 1) / length;
    std::vector<Gram> parts(blocks, Gram(2));
    parallel_blocks(blocks, threads, [&](std::size_t block) {
      const std::size_t first = block * length;
      const double* const columns[] = {x.data() + first, y.data() + first};
      parts[block].add(columns, std::min(length, x.size() - first));
    });
    Gram sum(2);
    for (const Gram& part : parts) sum += part;
    return sum;
  };
  const Gram one = total(1);
  for (const int threads : {0, 2, 3, 8}) {
    const Gram many = total(threads);
    CHECK(std::memcmp(one.high.data(), many.high.data(), 4 * sizeof(double)) == 0);
  }
}

TEST_CASE("every block is run once and none when there are none") {
  for (const std::size_t blocks : {0u, 1u, 2u, 100u}) {
    std::vector<std::atomic<int>> runs(blocks);
    parallel_blocks(blocks, 4, [&](std::size_t block) { ++runs[block]; });
    for (const auto& count : runs) CHECK(count == 1);
  }
}

TEST_CASE("an error in a block reaches the caller") {
  for (const int threads : {1, 2}) {
    const auto run = [&] {
      parallel_blocks(50, threads, [](std::size_t block) {
        if (block == 3) throw std::runtime_error("block 3");
      });
    };
    CHECK_THROWS_WITH_AS(run(), "block 3", std::runtime_error);
  }
}

TEST_CASE("a loop has the same bits on every instruction set") {
  constexpr std::size_t n = 1003;
  std::vector<double> in(n), first(n), out(n);
  for (std::size_t k = 0; k < n; ++k) in[k] = std::cos(static_cast<double>(k));
  const auto loop = [&in](double* to) {
    const double* const from = in.data();
    for (std::size_t k = 0; k < n; ++k) {
      const double x = from[k] < 0 ? -from[k] : from[k];
      to[k] = (x * 0.3 + 0.7) * x + 1.0 / (x * x + 0.1);  // contraction would change the bits
    }
  };
  loop(first.data());
  for (const Isa isa : all_isas) {
    if (kernels_of(isa) == nullptr) {
      MESSAGE("skipped: this machine cannot run loops for ", name_of(isa));
      continue;
    }
    run_as(isa, [&] { loop(out.data()); });
    CHECK(std::memcmp(first.data(), out.data(), n * sizeof(double)) == 0);
  }
  run_wide([&] { loop(out.data()); });
  CHECK(std::memcmp(first.data(), out.data(), n * sizeof(double)) == 0);
}

TEST_CASE("the instruction set in use is one that this machine can run") {
  CHECK(kernels_of(isa_in_use()) == &kernels());
  CHECK(isa() == name_of(isa_in_use()));
  CHECK(kernels_of(Isa::baseline) != nullptr);
}

TEST_CASE("the environment forces an instruction set that the machine has") {
  const char* const forced = std::getenv("FLEXSPLINE_ISA");
  if (forced == nullptr) {
    MESSAGE("skipped: FLEXSPLINE_ISA is not set");
    return;
  }
  for (const Isa isa_of_table : all_isas) {
    if (name_of(isa_of_table) != forced) continue;
    if (kernels_of(isa_of_table) == nullptr) {
      MESSAGE("skipped: this machine cannot run ", name_of(isa_of_table));
    } else {
      CHECK(isa() == forced);
    }
  }
}
