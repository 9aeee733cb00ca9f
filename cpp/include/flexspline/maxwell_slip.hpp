/// Hysteresis from the path alone: springs side by side, each of which slips at its own width.
///
///   z_k ← clamp(z_k + Δu, −w_k, w_k),     w_k = w / 2^k,  k = 0 … N − 1
///
/// u is any path, a torque [Nm] or an angle [turns]; how fast it is taken does not matter. Rows are
/// the shares z_k / w_k in [−1, 1]: a coefficient is half the height of the loop that its element
/// makes. After a reversal all are still; the narrowest slips first. N widths of fixed ratios stand
/// for any loop that turns over that range, and stay linear in their heights.
///
/// The first sample starts at rest in the middle, z = 0, which is a guess. The widest element truly
/// lay anywhere in [−w, w]: `low` and `high` follow both ends and meet once the path has covered
/// 2 w. From there on no row depends on the guess.
///
/// A path's places are first rounded `on_grid`: to multiples of the last binary place of w (within
/// 2.4e-7 w in float; as coarse as they are themselves far beyond w). On that grid all sums are
/// exact, so a spring that never slips is where it was whenever the path is, after any number of
/// steps.
/// Source: [AlBender2005], The generalized Maxwell-slip model; in gears
/// full_range_torque_estimation §I and its ref. 13 [Tjahjowidodo2013].
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

  /// A place of the path, Nm, on the grid of a width in Nm.
  static constexpr S on_grid(S place, S width) noexcept {
    const S shift = S(3) * power_of_two(width);
    return (place + shift) - shift;
  }
  /// A place of the path on the grid of a width in turns.
  static constexpr Phase<S> on_grid(Phase<S> place, S width) noexcept {
    using Bits = math::Bits<S>;
    constexpr int bias = std::numeric_limits<S>::max_exponent - 1;
    constexpr int most_dropped = 8 * int(sizeof(S)) - 4;  // widths of a million turns
    constexpr int spare = 8 * int(sizeof(S)) - std::numeric_limits<S>::digits + 2;
    const int exponent = static_cast<int>(std::bit_cast<Bits>(width) >> math::mantissa_bits<S>);
    const int dropped = exponent - bias + spare;  // bits of the fraction below the grid
    if (dropped <= 0) return place;
    const Bits step = Bits(1) << (dropped < most_dropped ? dropped : most_dropped);
    return {(place.fraction + step / 2) & ~(step - 1)};
  }

  /// Moves on by `moved`, between places on the grid; a state that has not started takes its place
  /// in the middle instead. `width` > 0 is that of the widest element.
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

 private:
  /// The largest power of two that is not above a positive number.
  static constexpr S power_of_two(S x) noexcept {
    constexpr auto exponent = std::bit_cast<math::Bits<S>>(std::numeric_limits<S>::infinity());
    return std::bit_cast<S>(std::bit_cast<math::Bits<S>>(x) & exponent);
  }
};

}  // namespace flexspline
