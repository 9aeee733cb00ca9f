/// Parameters that are replaced while the joint runs, at once and between two steps.
///
/// Two copies: the control loop reads one, the loader writes the other and hands it over. `take` is
/// called once at the start of each step, by the loop alone; `load` by one other thread, or by the
/// main program where the loop is an interrupt. Neither waits for the other: before the loop has
/// taken the last parameters, `load` says `busy`. The memory of the estimators is not here and goes
/// on. Needs an atomic byte without a lock, which every Cortex-M has.
#pragma once

#include <array>
#include <atomic>

#include "flexspline/block.hpp"

namespace flexspline {

template <typename T>
class Swap {
 public:
  constexpr explicit Swap(const T& first) noexcept : copies_{first, first} {}

  /// The parameters of this step; valid until the next call.
  const T& take() noexcept {
    const std::uint8_t current = handed_.load(std::memory_order_acquire);
    taken_.store(current, std::memory_order_release);
    return copies_[current];
  }

  /// Replaces all parameters by those of a block from the next `take` on, or changes nothing.
  BlockStatus load(Bytes bytes) noexcept {
    const std::uint8_t current = handed_.load(std::memory_order_relaxed);
    if (taken_.load(std::memory_order_acquire) != current) return BlockStatus::busy;
    const auto spare = static_cast<std::uint8_t>(1 - current);
    const BlockStatus status = flexspline::load(bytes, copies_[spare]);
    if (status == BlockStatus::ok) handed_.store(spare, std::memory_order_release);
    return status;
  }

 private:
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free);
  std::array<T, 2> copies_;
  std::atomic<std::uint8_t> handed_{0};
  std::atomic<std::uint8_t> taken_{0};
};

}  // namespace flexspline
