/// A loop that is written out.
#pragma once

#include <cstddef>
#include <utility>

namespace flexspline {

/// use(0), use(1), … use(N − 1); up to 32 of them written out, so that what is constant folds.
template <std::size_t N, typename Use>
constexpr void for_each_place(const Use& use) noexcept {
  if constexpr (N <= 32) {
    [&use]<std::size_t... I>(std::index_sequence<I...>) {
      (use(I), ...);
    }(std::make_index_sequence<N>{});
  } else {
    for (std::size_t k = 0; k < N; ++k) use(k);
  }
}

}  // namespace flexspline
