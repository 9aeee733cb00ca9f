#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/lagged_slope.hpp"

namespace flexspline {

/// A sensor, or a drive, whose torque is recorded later than the load.
///
///   τ = −c s,     t_s ds/dt = dτ_load/dt − s
///
/// s: how fast the load changes, smoothed by t_s (see LaggedSlope). c, the coefficient, is how late
/// the reading is, in s. To the second order in the lateness a filter of first order with the time
/// constant c has t_s = c (then τ_load + τ is that filter, exactly), a pure delay c has t_s = c/2:
/// so a fit tells which. While the load stands: 0. Linear in c.
/// Source: first-order lag and Padé's form of a delay, in any book on control.
template <typename S>
struct SensorLag {
  using Slope = LaggedSlope<S>;

  static constexpr std::string_view name = "sensor_lag";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "the residual follows how fast the load changes, against it";
  static constexpr std::string_view source = "first-order lag and Padé's form of a delay";
  static constexpr std::array<Term, 1> terms{{{"lateness", "s"}}};
  static constexpr std::array<Channel, 2> reads{Channel::load, Channel::period};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::any_load}}};

  struct State {
    typename Slope::State load;
  };

  S smoothing_time = S(0.01);  ///< t_s, s, > 0

  static constexpr auto shapes() noexcept {
    return std::array{Shape<SensorLag, S>{"smoothing_time", "s", &SensorLag::smoothing_time,
                                          S(1e-4), S(10), true}};
  }

  constexpr S stateless_part(const Sample<S>& at) const noexcept {
    return Slope::share(at.period, smoothing_time);
  }

  constexpr Row<S, 1> row(const Sample<S>& at, State& state, S share) const noexcept {
    Slope::step(state.load, at.load, at.period, share);
    return {-state.load.slope};
  }

  constexpr Row<S, 1> row(const Sample<S>& at, State& state) const noexcept {
    return row(at, state, stateless_part(at));
  }

  constexpr bool settled(const State& state) const noexcept { return Slope::settled(state.load); }
};

}  // namespace flexspline
