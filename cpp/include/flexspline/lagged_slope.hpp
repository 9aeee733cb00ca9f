/// How fast a channel changes, smoothed by a first-order lag.
///
///   s ← s + (1 − e^(−t / τ)) (Δu / t − s)
///
/// τ s is how far a lag of τ is behind u: the step is exact where u goes straight from sample to
/// sample. With τ far below the period t, s is the plain difference. The first sample starts with
/// s = 0, as if u had stood still before; `unknown` is the share of s that still hangs on this. A
/// finite u from which the slope overflows starts it anew: what is remembered is near the largest
/// number, and would keep the slope infinite for ever.
///
/// The sum carries its rounding on [Kahan1965]: in float the small steps of a lag of minutes at
/// 1 kHz would else be lost.
#pragma once

#include "flexspline/math.hpp"

namespace flexspline {

template <typename S>
struct LaggedSlope {
  struct State {
    S last = 0;     ///< u of the last sample
    S slope = 0;    ///< s, units of u per second
    S lost = 0;     ///< what rounding took from s
    S unknown = 1;  ///< e^(−(time since the start) / τ)
    bool started = false;
  };

  /// 1 − e^(−t / τ), the part of a step that needs no memory; `period` > 0 in s, `time_constant`
  /// τ > 0 in s.
  static constexpr S share(S period, S time_constant) noexcept {
    return -math::expm1_negative(math::clamp(period / time_constant, S(0), S(50)));
  }

  /// `period` > 0 in s, and its share.
  static constexpr void step(State& state, S value, S period, S share) noexcept {
    if (!state.started) {
      state = {value, S(0), S(0), S(1), true};
      return;
    }
    const S change = share * ((value - state.last) / period - state.slope) - state.lost;
    const S slope = state.slope + change;
    if (!math::is_finite(slope) && math::is_finite(value)) [[unlikely]] {
      state = {value, S(0), S(0), S(1), true};
      return;
    }
    state.lost = (slope - state.slope) - change;
    state.slope = slope;
    state.unknown = math::clamp(state.unknown * (S(1) - share), S(1e-6), S(1));
    state.last = value;
  }

  /// Whether the start no longer matters, to a thousandth.
  static constexpr bool settled(const State& state) noexcept {
    return state.started && state.unknown < S(1e-3);
  }
};

}  // namespace flexspline
