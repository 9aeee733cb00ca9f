#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/lagged_slope.hpp"

namespace flexspline {

/// Drift while the temperature changes: one side of the bridge warms before the other.
///
///   τ = c (T − T_b),     t_lag dT_b/dt = T − T_b
///
/// T_b: the temperature, late by a first-order lag (see LaggedSlope). While T rises steadily:
/// c t_lag dT/dt. Once the heat has spread: 0. The first sample of a run starts at 0: the joint is
/// taken to have stood in one temperature before. Linear in c, the `gradient` of a
/// temperature compensation.
/// Source: the step beyond zhang_disturbance_elimination §4.2, which leaves out that the drift
/// differs between warming and cooling.
template <typename S>
struct ThermalGradientDrift {
  using Slope = LaggedSlope<S>;

  static constexpr std::string_view name = "thermal_gradient_drift";
  static constexpr std::string_view targets = "S";
  static constexpr std::string_view signature =
      "the zero moves while the joint warms or cools, and comes back";
  static constexpr std::string_view source = "zhang_disturbance_elimination §4.2, a step beyond";
  static constexpr std::array<Term, 1> terms{{{"gradient", "Nm/K"}}};
  static constexpr std::array<Channel, 2> reads{Channel::temperature, Channel::period};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::temperature, 2}}};

  struct State {
    typename Slope::State temperature;
  };

  S thermal_lag = S(60);  ///< t_lag, s, > 0

  static constexpr auto shapes() noexcept {
    return std::array{Shape<ThermalGradientDrift, S>{
        "thermal_lag", "s", &ThermalGradientDrift::thermal_lag, S(0.1), S(1e4), true}};
  }

  constexpr S stateless_part(const Sample<S>& at) const noexcept {
    return Slope::share(at.period, thermal_lag);
  }

  constexpr Row<S, 1> row(const Sample<S>& at, State& state, S share) const noexcept {
    Slope::step(state.temperature, at.temperature, at.period, share);
    return {thermal_lag * state.temperature.slope};
  }

  constexpr Row<S, 1> row(const Sample<S>& at, State& state) const noexcept {
    return row(at, state, stateless_part(at));
  }

  /// By what is said of the start, at once: a burn-in would cost just the warming that shows it.
  constexpr bool settled(const State& state) const noexcept { return state.temperature.started; }
};

}  // namespace flexspline
