#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Slow change of the zero with time that temperature does not explain: creep, ageing, a gauge that
/// comes loose.
///
///   τ = c₁ t + c₂ t²
///
/// t: since the run began. At the start: 0. Linear in both. What begins anew with each run and
/// what goes on from run to run look alike; a run that lasts longer than those of the fit is
/// extrapolated.
/// Source: none of the papers; the creep that every data sheet of strain gauges states.
template <typename S>
struct TimeDrift {
  static constexpr std::string_view name = "time_drift";
  static constexpr std::string_view targets = "SD";
  static constexpr std::string_view signature =
      "the residual wanders slowly from the start of a run to its end";
  static constexpr std::string_view source = "creep, as data sheets of strain gauges state it";
  static constexpr std::array<Term, 2> terms{{{"linear", "Nm/s"}, {"quadratic", "Nm/s²"}}};
  static constexpr std::array<Channel, 1> reads{Channel::time};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::duration, 60}}};

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    return {at.time, at.time * at.time};
  }
};

}  // namespace flexspline
