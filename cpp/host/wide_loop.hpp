/// Runs a loop compiled for the widest instruction set of this machine.
///
///   run_wide([&] { for (std::size_t i = 0; i < n; ++i) out[i] = formula(in[i]); });
///
/// The loop, and every function it calls, is inlined into three functions that differ in their
/// target only. So no inline function of a shared header is ever compiled for AVX under its plain
/// name (linked into the portable path it would crash older machines). Formulas are as written:
/// with -ffp-contract=off the results have the same bits in all three.
///
/// For the loop to become vector code: no branches but `a < b ? x : y`, local pointers, and the
/// flags -O3 -fno-trapping-math -fno-math-errno in the including file. Measured (tanh + exp per
/// sample): 13.7 ns baseline, 6.4 ns v3; without -fno-trapping-math 24 ns in both.
/// With other compilers than GCC on x86-64 the loop runs as compiled.
#pragma once

#include "host/kernels.hpp"

namespace flexspline::batch {

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__)

template <typename Loop>
[[gnu::target("arch=x86-64-v4,prefer-vector-width=512"),
  gnu::flatten]] void run_v4(const Loop& loop) {
  loop();
}

template <typename Loop>
[[gnu::target("arch=x86-64-v3"), gnu::flatten]] void run_v3(const Loop& loop) {
  loop();
}

/// The loop as compiled for one instruction set, which the machine must have (`kernels_of`).
template <typename Loop>
void run_as(Isa isa, const Loop& loop) {
  if (isa == Isa::v4) {
    run_v4(loop);
  } else if (isa == Isa::v3) {
    run_v3(loop);
  } else {
    loop();
  }
}

#else

template <typename Loop>
void run_as(Isa, const Loop& loop) {
  loop();
}

#endif

template <typename Loop>
void run_wide(const Loop& loop) {
  run_as(isa_in_use(), loop);
}

}  // namespace flexspline::batch
