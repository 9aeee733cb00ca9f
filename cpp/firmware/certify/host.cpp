// The machine that certify's program is compiled on: rows on standard input, results on output.
#include <cstdio>

#include "board.hpp"

std::size_t board::read(void* to, std::size_t size) noexcept {
  return std::fread(to, 1, size, stdin);
}

bool board::write(const void* from, std::size_t size) noexcept {
  return std::fwrite(from, 1, size, stdout) == size;
}

void board::start() noexcept {}

std::uint32_t board::stop() noexcept { return 0; }

void board::paint() noexcept {}

std::uint32_t board::painted_over() noexcept { return 0; }
