// The parameters of an exported joint or model as a block: its own ones out, others in.
//
//   block float|double < nothing > its own block
//   block float|double < a block > status of loading it (one byte), then its block after that
#include "flexspline/block.hpp"

#include <cstdio>
#include <cstring>
#include <vector>

#include "joint.hpp"
#include "saved.hpp"

#ifndef MADE
#define MADE joint::joint
#endif

namespace {

template <typename T>
int answer(T made) {
  std::vector<std::uint8_t> given(1 << 16);
  given.resize(std::fread(given.data(), 1, given.size(), stdin));
  if (!given.empty()) {
    const auto status = static_cast<std::uint8_t>(flexspline::load(given, made));
    if (std::fwrite(&status, 1, 1, stdout) != 1) return 1;
  }
  return write_block(made);
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  const bool single = std::strcmp(arguments[1], "float") == 0;
  return single ? answer(MADE<float>) : answer(MADE<double>);
}
