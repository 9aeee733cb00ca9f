// A joint that learns: readings in, the block of what it learned out.
//
//   learn float|double < rows of period, velocity, motor torque (doubles) > its block behind them
#include <cstdio>
#include <cstring>
#include <vector>

#include "flexspline/block.hpp"
#include "joint.hpp"

namespace {

template <typename S>
int learn() {
  auto made = joint::joint<S>;
  typename joint::Joint<S>::State state;
  typename joint::Joint<S>::Chain::Output out;
  std::array<double, 3> row;
  while (std::fread(row.data(), sizeof row, 1, stdin) == 1) {
    flexspline::Reading<S> in;
    in.period = S(row[0]);
    in.output_velocity = S(row[1]);
    in.motor_torque = S(row[2]);
    if (made.step(state, in, out) != flexspline::Status::ok) return 1;
  }
  made.adopt(state);
  std::vector<std::uint8_t> bytes(flexspline::block_size(made));
  std::size_t size = 0;
  if (flexspline::save(made, bytes, size) != flexspline::BlockStatus::ok) return 1;
  return std::fwrite(bytes.data(), 1, size, stdout) == size ? 0 : 1;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  return std::strcmp(arguments[1], "float") == 0 ? learn<float>() : learn<double>();
}
