/// Runs fn(block) for block = 0..blocks-1 on a few threads of its own.
///
/// Which thread takes which block is not fixed, so fn writes only to what belongs to its block;
/// results merged afterwards in the order of the blocks do not depend on the number of threads.
/// `threads` <= 1 runs in the calling thread. The first exception (lowest block) is thrown again in
/// the caller after all threads have ended; blocks not yet begun are then left out.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace flexspline::batch {

template <typename Fn>
void parallel_blocks(std::size_t blocks, int threads, Fn&& fn) {
  std::atomic<std::size_t> next{0};
  std::mutex guard;
  std::exception_ptr failure;
  std::size_t failed_block = blocks;
  const auto work = [&] {
    for (std::size_t block = next++; block < blocks; block = next++) {
      try {
        fn(block);
      } catch (...) {
        const std::lock_guard lock(guard);
        if (block < failed_block) {
          failure = std::current_exception();
          failed_block = block;
        }
        next = blocks;
      }
    }
  };
  const std::size_t helpers = std::min(blocks, static_cast<std::size_t>(std::max(threads, 1)));
  std::vector<std::thread> pool;
  pool.reserve(helpers);
  for (std::size_t helper = 1; helper < helpers; ++helper) {
    try {
      pool.emplace_back(work);
    } catch (const std::system_error&) {
      break;  // no more threads to be had: those there do the work
    }
  }
  work();
  for (std::thread& helper : pool) helper.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace flexspline::batch
