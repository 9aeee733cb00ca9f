#pragma once

#include "flexspline/effects/harmonics.hpp"

namespace flexspline {

/// Ripple at harmonics of the joint angle, whatever the speed.
///
///   τ = Σ_k  a_k cos(k q) + b_k sin(k q)
///
/// Linear in a and b. Order 1 alone is gravity.
/// Source: turlapati_intrinsic_dynamics (12), (13).
template <typename S, std::size_t K>
struct OutputRipple : Harmonics<S, K> {
  static constexpr std::string_view name = "output_ripple";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "a pattern over the joint angle that repeats in both directions";
  static constexpr std::string_view source = "turlapati_intrinsic_dynamics (12), (13)";
  static constexpr std::array<Channel, 1> reads{Channel::output_position};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::turn, 1}}};
  static constexpr std::array<Pair, 1> pairs{Pair::output_on_housing};
};

}  // namespace flexspline
