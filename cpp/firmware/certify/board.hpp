/// What certify's program asks of the machine it runs on: host.cpp or cortex_m/board.cpp.
#pragma once

#include <cstddef>
#include <cstdint>

namespace board {

/// The next bytes of the rows, as many as there are up to `size`.
std::size_t read(void* to, std::size_t size) noexcept;

/// Appends to the results; whether it was written.
bool write(const void* from, std::size_t size) noexcept;

/// Ticks between two readings of the clock; one of them is `start`, the other `stop`.
void start() noexcept;
std::uint32_t stop() noexcept;

/// Fills the unused stack with a mark; then how much of it was overwritten since, in bytes.
void paint() noexcept;
std::uint32_t painted_over() noexcept;

}  // namespace board
