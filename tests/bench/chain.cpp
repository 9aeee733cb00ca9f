// Nanoseconds for one step of an exported chain, and how often a step calls the heap.
//
//   chain < rows > median worst one high highest heap
//
// Rows are those of certify (cpp/firmware/certify/rows.hpp), read before anything is timed; a step
// includes taking its row over. `median` and `worst` are of batches of all rows, divided by their
// number; `one`, `high`, `highest` are median, 99.9 % and worst of steps timed one by one, with the
// clock's own time.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <vector>

#include "unit.hpp"

namespace {

using Clock = std::chrono::steady_clock;
using Row = certify::Row<unit::Scalar>;

std::size_t heap_calls = 0;

double nanoseconds(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::nano>(to - from).count();
}

std::vector<Row> read_rows() {
  std::vector<Row> rows;
  Row row{};
  while (std::fread(&row, sizeof row, 1, stdin) == 1) rows.push_back(row);
  return rows;
}

/// Steps through all rows; how many were refused.
int pass(const std::vector<Row>& rows) {
  int refused = 0;
  for (const Row& row : rows) {
    unit::take(row);
    refused += flexspline_step() != flexspline::Status::ok;
  }
  return refused;
}

double at(std::vector<double>& times, double share) {
  std::sort(times.begin(), times.end());
  return times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
}

}  // namespace

// Every way to the heap, counted.
extern "C" void* __real_malloc(std::size_t size);
extern "C" void* __wrap_malloc(std::size_t size) {
  ++heap_calls;
  return __real_malloc(size);
}
void* operator new(std::size_t size) { return __wrap_malloc(size); }
void operator delete(void* place) noexcept { std::free(place); }
void operator delete(void* place, std::size_t) noexcept { std::free(place); }

int main(int count, char** arguments) {
  const int batches = count > 1 ? std::atoi(arguments[1]) : 500;
  const std::vector<Row> rows = read_rows();
  std::vector<double> means, singles;
  means.reserve(static_cast<std::size_t>(batches));
  singles.reserve(rows.size() * 20);
  const std::size_t before = heap_calls;
  int refused = pass(rows);
  for (int k = 0; k < batches; ++k) {
    const auto start = Clock::now();
    refused += pass(rows);
    means.push_back(nanoseconds(start, Clock::now()) / static_cast<double>(rows.size()));
  }
  for (int k = 0; k < 20; ++k) {
    for (const Row& row : rows) {
      const auto start = Clock::now();
      unit::take(row);
      refused += flexspline_step() != flexspline::Status::ok;
      singles.push_back(nanoseconds(start, Clock::now()));
    }
  }
  const std::size_t heap = heap_calls - before;
  if (refused != 0 || before == 0) return 1;  // the rows themselves came from the heap
  std::printf("%.1f %.1f %.0f %.0f %.0f %zu\n", at(means, 0.5), at(means, 1.0), at(singles, 0.5),
              at(singles, 0.999), at(singles, 1.0), heap);
}
