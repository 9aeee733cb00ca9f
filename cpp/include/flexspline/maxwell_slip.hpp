/// Hysteresis from the path alone: springs side by side, each of which slips at its own width.
///
///   z_k ← clamp(z_k + Δu, −w_k, w_k),     w_k = w / 2^k,  k = 0 … N − 1
///
/// u is any path, a torque [Nm] or an angle [rad]; how fast it is taken does not matter. Rows are
/// the shares z_k / w_k in [−1, 1]: a coefficient is half the height of the loop that its element
/// makes. After a reversal all are still; the narrowest slips first. N widths of fixed ratios stand
/// for any loop that turns over that range, and stay linear in their heights.
///
/// The first sample starts at rest in the middle, z = 0, which is a guess. The widest element truly
/// lay anywhere in [−w, w]: `low` and `high` follow both ends and meet once the path has covered
/// 2 w. From there on no row depends on the guess.
///
/// In float a step below 6e-8 of a width is lost, less than a count of any encoder.
/// Source: Al-Bender et al. 2005, The generalized Maxwell-slip model; in gears
/// full_range_torque_estimation §I and its ref. 13 (Tjahjowidodo et al. 2013).
#pragma once

#include "flexspline/row.hpp"

namespace flexspline {

template <typename S, std::size_t N>
struct MaxwellSlip {
  struct State {
    std::array<S, N> stretch{};  ///< z, units of the path
    S low = 0;                   ///< the widest element had it started at −w, …
    S high = 0;                  ///< … and at w
    bool started = false;
  };

  /// Moves on by `moved`; a state that has not started takes its place in the middle instead.
  /// `width` > 0 is that of the widest element.
  static constexpr void step(State& state, S moved, S width) noexcept {
    if (!state.started) {
      state = {{}, -width, width, true};
      return;
    }
    const auto slip = [moved](S stretch, S limit) {
      return math::clamp(stretch + moved, -limit, limit);
    };
    state.low = slip(state.low, width);
    state.high = slip(state.high, width);
    for (S& stretch : state.stretch) {
      stretch = slip(stretch, width);
      width *= S(0.5);
    }
  }

  /// The shares z_k / w_k of the widths.
  static constexpr Row<S, N> shares(const State& state, S width) noexcept {
    Row<S, N> row{};
    for (std::size_t k = 0; k < N; ++k) {
      row[k] = state.stretch[k] / width;
      width *= S(0.5);
    }
    return row;
  }

  /// Whether the start no longer matters.
  static constexpr bool settled(const State& state) noexcept {
    return state.started && !(state.low < state.high);
  }
};

}  // namespace flexspline
