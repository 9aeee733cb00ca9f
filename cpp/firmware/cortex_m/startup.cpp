// From reset to main on a Cortex-M with an FPU: vector table, FPU on, .data and .bss.
#include <cstddef>
#include <cstdint>

#include "semihosting.hpp"

extern "C" {
extern std::uint32_t data_source, data_start, data_end, bss_start, bss_end, stack_top;
int program() noexcept asm("main");  // C++ lets nobody call main by its name
void reset() noexcept;
void fault() noexcept;
}

namespace {

struct Vectors {
  std::uint32_t* stack;
  void (*handlers[15])() noexcept;
};

/// The first sixteen entries: no interrupt is ever enabled.
[[gnu::section(".vectors"), gnu::used]] const Vectors vectors{
    &stack_top,
    {reset, fault, fault, fault, fault, fault, nullptr, nullptr, nullptr, nullptr, fault, fault,
     nullptr, fault, fault}};

/// Coprocessor access control register: full access to CP10 and CP11, the FPU.
void switch_fpu_on() noexcept {
  auto* const access = reinterpret_cast<volatile std::uint32_t*>(0xe000ed88U);
  *access = *access | (0xfU << 20);
  asm volatile("dsb\n isb" ::: "memory");
}

}  // namespace

extern "C" void reset() noexcept {
  switch_fpu_on();
  const std::uint32_t* from = &data_source;
  for (volatile std::uint32_t* to = &data_start; to != &data_end; to = to + 1) *to = *from++;
  for (volatile std::uint32_t* to = &bss_start; to != &bss_end; to = to + 1) *to = 0;
  semihosting::leave(program());
}

extern "C" void fault() noexcept { semihosting::leave(3); }
