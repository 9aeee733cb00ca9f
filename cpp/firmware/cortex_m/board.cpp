// A Cortex-M: rows.bin and results.bin by semihosting, SysTick as the clock, the stack painted.
#include "../certify/board.hpp"

#include "semihosting.hpp"

extern "C" std::uint32_t stack_top;

namespace {

constexpr std::uint32_t paint_mark = 0xc0dedeadU;
constexpr std::uint32_t painted_words = 1024;
constexpr std::uint32_t last_tick = 0xffffffU;  // SysTick counts down from here

volatile std::uint32_t* const systick = reinterpret_cast<volatile std::uint32_t*>(0xe000e010U);

constinit std::int32_t rows_file = -1;
constinit std::int32_t results_file = -1;
constinit std::uint32_t started = 0;
constinit bool running = false;

std::uint32_t* stack_pointer() noexcept {
  std::uint32_t* here;
  asm volatile("mov %0, sp" : "=r"(here));
  return here;
}

}  // namespace

std::size_t board::read(void* to, std::size_t size) noexcept {
  if (rows_file < 0) rows_file = semihosting::open("rows.bin", 1);
  return rows_file < 0 ? 0 : size - semihosting::read(rows_file, to, size);
}

bool board::write(const void* from, std::size_t size) noexcept {
  if (results_file < 0) results_file = semihosting::open("results.bin", 5);
  return results_file >= 0 && semihosting::write(results_file, from, size) == 0;
}

void board::start() noexcept {
  if (!running) {
    systick[1] = last_tick;  // reload
    systick[2] = 0;          // begin anew
    systick[0] = 5;          // on, by the processor's clock, without interrupt
    running = true;          // left to run: an emulator's registers are slow to reach
  }
  started = systick[2];
}

std::uint32_t board::stop() noexcept { return (started - systick[2]) & last_tick; }

[[gnu::noinline]] void board::paint() noexcept {
  volatile std::uint32_t* place = stack_pointer();
  for (std::uint32_t k = 0; k < painted_words; ++k) *--place = paint_mark;
}

[[gnu::noinline]] std::uint32_t board::painted_over() noexcept {
  const volatile std::uint32_t* const top = stack_pointer();
  const volatile std::uint32_t* place = top - painted_words;
  while (place != top && *place == paint_mark) ++place;
  return static_cast<std::uint32_t>(top - place) * 4;
}
