/// A check by the kernels of each instruction set.
#pragma once

#include <doctest/doctest.h>

#include "host/kernels.hpp"

namespace flexspline::batch {

/// Calls check(kernels) for each instruction set that this machine has; says which it has not.
template <typename Check>
void for_every_isa(Check check) {
  for (const Isa isa : all_isas) {
    const Kernels* const table = kernels_of(isa);
    if (table == nullptr) {
      MESSAGE("skipped: this machine cannot run the kernels for ", name_of(isa));
      continue;
    }
    CAPTURE(name_of(isa));
    check(*table);
  }
}

}  // namespace flexspline::batch
