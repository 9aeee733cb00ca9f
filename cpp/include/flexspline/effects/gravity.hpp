#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// An unbalanced mass in the field of gravity.
///
///   τ = c_s sin q + c_c cos q
///
/// One period per turn of the joint. Linear in both. Part of the load that the gear transmits.
/// Source: zhang_disturbance_elimination (23).
template <typename S>
struct Gravity {
  static constexpr std::string_view name = "gravity";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "one sine per turn of the joint, the same in both directions";
  static constexpr std::string_view source = "zhang_disturbance_elimination (23)";
  static constexpr std::array<Term, 2> terms{{{"sine", "Nm"}, {"cosine", "Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_position};
  static constexpr Traits traits{.basic = true, .carries_load = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::turn, 0.5}}};

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    const math::Phasor<S> p = at.output_position.phase.phasor();
    return {p.sine, p.cosine};
  }
};

}  // namespace flexspline
