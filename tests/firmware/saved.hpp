// The parameters of an exported joint or model, written to standard output as a block.
#pragma once

#include <cstdint>
#include <cstdio>
#include <vector>

#include "flexspline/block.hpp"

/// What the program returns: 0 where the whole block was written.
template <typename T>
int write_block(const T& made) {
  std::vector<std::uint8_t> bytes(flexspline::block_size(made));
  std::size_t size = 0;
  if (flexspline::save(made, bytes, size) != flexspline::BlockStatus::ok) return 1;
  return std::fwrite(bytes.data(), 1, size, stdout) == size ? 0 : 1;
}
