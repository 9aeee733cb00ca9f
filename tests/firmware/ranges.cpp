// A device that says of each sample whether the model was fitted there.
//
//   ranges float|double radians < rows > results
//
// Rows are those of rows.hpp with angles in radians; a result is two doubles: flags and zero.
#include <array>
#include <cstdio>
#include <cstring>

#include "joint.hpp"
#include "rows.hpp"

namespace {

template <typename S>
int stream() noexcept {
  flexspline::Sample<S> at;
  std::array<double, 11> row{};
  while (std::fread(row.data(), sizeof row, 1, stdin) == 1) {
    at.output_position = flexspline::Angle<S>::from_radians(static_cast<S>(row[0]));
    at.motor_position = flexspline::Angle<S>::from_radians(static_cast<S>(row[2]));
    read_numbers(row, at);
    const std::array<double, 2> result{static_cast<double>(joint::validity::flags(at)), 0.0};
    if (std::fwrite(result.data(), sizeof result, 1, stdout) != 1) return 1;
  }
  return 0;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) return 2;
  return std::strcmp(arguments[1], "float") == 0 ? stream<float>() : stream<double>();
}
