/// Files of the machine that debugs or emulates this one (Arm semihosting 2.0, for M profile).
#pragma once

#include <cstddef>
#include <cstdint>

namespace semihosting {

/// Operation `number` with its block of arguments; what it returns.
inline std::int32_t call(std::uint32_t number, const void* arguments) noexcept {
  register std::uint32_t r0 asm("r0") = number;
  register const void* r1 asm("r1") = arguments;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return static_cast<std::int32_t>(r0);
}

inline std::uint32_t word(const void* pointer) noexcept {
  return reinterpret_cast<std::uint32_t>(pointer);
}

/// SYS_OPEN; `mode` 1 reads, 5 writes, both binary. −1 where it cannot be opened.
template <std::size_t N>
std::int32_t open(const char (&name)[N], std::uint32_t mode) noexcept {
  const std::uint32_t block[]{word(name), mode, N - 1};
  return call(0x01, block);
}

/// SYS_READ and SYS_WRITE: how many bytes were left over.
inline std::size_t read(std::int32_t file, void* to, std::size_t size) noexcept {
  const std::uint32_t block[]{static_cast<std::uint32_t>(file), word(to), size};
  return static_cast<std::size_t>(call(0x06, block));
}
inline std::size_t write(std::int32_t file, const void* from, std::size_t size) noexcept {
  const std::uint32_t block[]{static_cast<std::uint32_t>(file), word(from), size};
  return static_cast<std::size_t>(call(0x05, block));
}

/// SYS_EXIT_EXTENDED: ends the emulation with this exit code.
[[noreturn]] inline void leave(int code) noexcept {
  const std::uint32_t block[]{0x20026U, static_cast<std::uint32_t>(code)};
  for (;;) call(0x20, block);
}

}  // namespace semihosting
