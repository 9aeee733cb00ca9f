// A joint that learns: readings in, the block of what it learned out.
//
//   learn float|double < rows of period, velocity, motor torque (doubles) > its block behind them
#include <array>
#include <cstdio>
#include <cstring>

#include "joint.hpp"
#include "saved.hpp"

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
  return write_block(made);
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  return std::strcmp(arguments[1], "float") == 0 ? learn<float>() : learn<double>();
}
