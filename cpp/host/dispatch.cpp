/// Which instruction set this machine runs.
#include <cstdlib>

#include "host/kernels.hpp"

namespace flexspline::batch {

extern const Kernels kernels_baseline;
#if defined(FLEXSPLINE_X86_TABLES)
extern const Kernels kernels_v3;
extern const Kernels kernels_v4;
#endif

namespace {

bool runs_here([[maybe_unused]] Isa isa) noexcept {
#if defined(FLEXSPLINE_X86_TABLES)
  if (isa == Isa::v3) {
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
           __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  }
  if (isa == Isa::v4) {
    return runs_here(Isa::v3) && __builtin_cpu_supports("avx512f") &&
           __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  }
#endif
  return isa == Isa::baseline;
}

Isa best_isa() noexcept {
  const char* const forced = std::getenv("FLEXSPLINE_ISA");
  Isa best = Isa::baseline;
  for (const Isa isa : all_isas) {
    if (runs_here(isa)) best = isa;
    if (forced != nullptr && name_of(isa) == forced) break;
  }
  return best;
}

}  // namespace

const Kernels* kernels_of(Isa isa) noexcept {
  if (!runs_here(isa)) return nullptr;
#if defined(FLEXSPLINE_X86_TABLES)
  if (isa == Isa::v3) return &kernels_v3;
  if (isa == Isa::v4) return &kernels_v4;
#endif
  return &kernels_baseline;
}

std::string_view name_of(Isa isa) noexcept {
  return isa == Isa::v4 ? "v4" : isa == Isa::v3 ? "v3" : "baseline";
}

Isa isa_in_use() noexcept {
  static const Isa chosen = best_isa();
  return chosen;
}

const Kernels& kernels() noexcept { return *kernels_of(isa_in_use()); }

std::string_view isa() noexcept { return name_of(isa_in_use()); }

}  // namespace flexspline::batch
