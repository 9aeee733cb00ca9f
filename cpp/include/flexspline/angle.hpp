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
  /// Turns in [−1/2, 1/2): the shortest way from zero.
  constexpr S shortest() const noexcept {
    constexpr S unit = sizeof(S) == 4 ? S(1.0L / 4294967296.0L)
                                      : S(1.0L / 4294967296.0L / 4294967296.0L);
    return static_cast<S>(static_cast<std::make_signed_t<math::Bits<S>>>(fraction)) * unit;
  }
  constexpr math::Phasor<S> phasor() const noexcept { return math::phasor<S>(fraction); }
};

/// An angle: `turns` + `phase`, the phase in [0, 1) turns.
template <typename S>
struct Angle {
  std::int32_t turns = 0;
  Phase<S> phase;

  /// Beyond ±2^30 turns the turns saturate; NaN gives zero (see read_radians).
  static constexpr Angle from_turns(S value) noexcept {
    constexpr S limit = S(1073741824);
    const S held = value == value ? math::clamp(value, -limit, limit) : S(0);
    const auto truncated = static_cast<std::int32_t>(held);
    const std::int32_t whole = truncated - (static_cast<S>(truncated) > held ? 1 : 0);
    const S part = held - static_cast<S>(whole);
    const bool carried = !(part < S(1));  // −1e-20 turns: one less its own rounding
    return {whole + (carried ? 1 : 0), {carried ? 0 : fraction_of(part)}};
  }
  static constexpr Angle from_radians(S value) noexcept {
    return from_turns(value * (S(0.5L) / math::pi<S>));
  }

 private:
  /// `part` in [0, 1) as an integer; exact to 2^−32 (float) and 2^−52 (double) turns.
  static constexpr math::Bits<S> fraction_of(S part) noexcept {
    if constexpr (sizeof(S) == 4) {
      return static_cast<std::uint32_t>(part * S(4294967296));
    } else {
      return std::bit_cast<std::uint64_t>(S(1) + part) << 12;
    }
  }
};

/// An encoder's angle in radians, refused where it is not finite: `angle` keeps its last value.
template <typename S>
constexpr Status read_radians(S radians, Angle<S>& angle) noexcept {
  if (!math::is_finite(radians)) return Status::not_finite;
  angle = Angle<S>::from_radians(radians);
  return Status::ok;
}

/// The upper half of the product of two fractions of a turn.
template <typename Unsigned>
constexpr Unsigned multiply_high(Unsigned a, Unsigned b) noexcept {
  if constexpr (sizeof(Unsigned) == 4) {
    return static_cast<Unsigned>((std::uint64_t(a) * b) >> 32);
  } else {
    const Unsigned mask = 0xffffffffU;
    const Unsigned cross = (a >> 32) * (b & mask) + (((a & mask) * (b & mask)) >> 32);
    const Unsigned other = (a & mask) * (b >> 32) + (cross & mask);
    return (a >> 32) * (b >> 32) + (cross >> 32) + (other >> 32);
  }
}

}  // namespace flexspline
