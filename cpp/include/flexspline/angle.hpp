/// Angles as whole turns and a fraction of a turn.
///
/// A float holds 3 rad to 2.4e-7 rad; times order 4200 that is 1e-3 rad of phase. A fraction
/// of a turn in all bits of an integer multiplies by an order without rounding: it wraps
/// where the angle wraps. Order 4200 is as good as order 1.
#pragma once

#include <cstdint>

#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

/// A fraction of a turn in units of 2^−32 (float) or 2^−64 (double) turns; wraps at one turn.
template <typename S>
struct Phase {
  math::Bits<S> fraction = 0;

  friend constexpr Phase operator+(Phase a, Phase b) noexcept { return {a.fraction + b.fraction}; }
  friend constexpr Phase operator-(Phase a, Phase b) noexcept { return {a.fraction - b.fraction}; }
  friend constexpr Phase operator*(math::Bits<S> order, Phase a) noexcept {
    return {order * a.fraction};
  }
  /// Turns in [−1/2, 1/2], the shortest way from zero, times what a turn counts for.
  constexpr S shortest(S turn = S(1)) const noexcept {
    constexpr S unit =
        sizeof(S) == 4 ? S(1.0L / 4294967296.0L) : S(1.0L / 4294967296.0L / 4294967296.0L);
    return static_cast<S>(static_cast<std::make_signed_t<math::Bits<S>>>(fraction)) * (unit * turn);
  }
  constexpr math::Phasor<S> phasor() const noexcept { return math::phasor<S>(fraction); }
};

/// An angle: `turns` + `phase`, the phase in [0, 1) turns.
template <typename S>
struct Angle {
  /// What turns count to: a motor at 100 turns per second is there after 124 days.
  static constexpr std::int32_t most_turns = 1 << 30;

  std::int32_t turns = 0;
  Phase<S> phase;

  /// Whether the turns are counted, not saturated.
  constexpr bool in_range() const noexcept { return turns >= -most_turns && turns < most_turns; }

  /// Exact to 2^−32 (float) or 2^−52 (double) turns on both sides of zero. Beyond ±2^30 turns
  /// the turns saturate just outside of the range; NaN does below it (see read_radians).
  static constexpr Angle from_turns(S value) noexcept {
    constexpr S limit = S(most_turns) + S(128);  // the next float
    const S above = value > -limit ? value : -limit;
    const S held = above < limit ? above : limit;
    const auto truncated = static_cast<std::int32_t>(held);
    const S part = math::absolute(held - static_cast<S>(truncated));  // no rounding
    const math::Bits<S> fraction = fraction_of(part);
    const std::int32_t carried = ((fraction == 0) & (part > S(0.5))) ? 1 : 0;  // 1 − 2^−53 is one
    const std::int32_t beyond = fraction != 0 ? 1 : carried;
    const bool negative = held < S(0);
    return {negative ? truncated - beyond : truncated + carried,
            {negative ? math::Bits<S>(0) - fraction : fraction}};
  }
  static constexpr Angle from_radians(S value) noexcept {
    return from_turns(value * (S(0.5L) / math::pi<S>));
  }

 private:
  /// `part` in [0, 1) as an integer; zero where it rounds to one.
  static constexpr math::Bits<S> fraction_of(S part) noexcept {
    if constexpr (sizeof(S) == 4) {
      return static_cast<std::uint32_t>(part * S(4294967296));
    } else {
      return std::bit_cast<std::uint64_t>(S(1) + part) << 12;
    }
  }
};

/// An encoder's angle in radians, refused where it is not finite, or where S has digits for no more
/// than quarters of a turn: 2^21 turns in float; in double 2^30, where turns saturate. `angle` keeps
/// its last value.
template <typename S>
constexpr Status read_radians(S radians, Angle<S>& angle) noexcept {
  constexpr S most = sizeof(S) == 4 ? S(1 << 21) : S(Angle<S>::most_turns);
  if (!math::is_finite(radians)) return Status::not_finite;
  if (!(math::absolute(radians) < most * S(2) * math::pi<S>)) return Status::out_of_range;
  angle = Angle<S>::from_radians(radians);
  return Status::ok;
}

/// `extrapolated` outside of [low, high] rad in every turn; never where that is a turn or more.
template <typename S>
constexpr Flag extrapolated(const Angle<S>& angle, S low, S high) noexcept {
  if (!(high - low < S(2) * math::pi<S>)) return Flag::none;
  const Phase<S> beyond_low = angle.phase - Angle<S>::from_radians(low).phase;
  const Phase<S> width = Angle<S>::from_radians(high - low).phase;
  return beyond_low.fraction > width.fraction ? Flag::extrapolated : Flag::none;
}

/// The upper half of the product of two fractions of a turn.
constexpr std::uint64_t multiply_high(std::uint64_t a, std::uint64_t b) noexcept {
  constexpr std::uint64_t mask = 0xffffffffU;
  const std::uint64_t cross = (a >> 32) * (b & mask) + (((a & mask) * (b & mask)) >> 32);
  const std::uint64_t other = (a & mask) * (b >> 32) + (cross & mask);
  return (a >> 32) * (b >> 32) + (cross >> 32) + (other >> 32);
}

}  // namespace flexspline
