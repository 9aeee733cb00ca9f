/// Where a function passes zero: the parabola on its side through the last three places, where they
/// lie so that it can be trusted, and the middle of the bracket elsewhere.
///
///   x = x₁ + t (x₂ − x₁)            x₁: the last place, x₂: the other end, x₃: the place before
///   t = f₁ f₃ / ((f₂ − f₁) (f₂ − f₃)) + (x₃ − x₁) / (x₂ − x₁) · f₁ f₂ / ((f₃ − f₁) (f₃ − f₂))
///   trusted where φ² < ξ and (1 − φ)² < 1 − ξ,   ξ = (x₁ − x₂)/(x₃ − x₂),  φ = (f₁ − f₂)/(f₃ − f₂)
///
/// t keeps half a tolerance away from both ends, so that the bracket closes from both sides. The
/// first place is the chord's. Superlinear where f is smooth; halves where f has kinks or a jump. It
/// ends after 60 rounds at the latest, whatever f says, NaN too.
/// Source: [Chandrupatla1997].
#pragma once

#include "flexspline/math.hpp"

namespace flexspline {

/// A place and what a function is there.
template <typename S>
struct Place {
  S at;
  S value;
};

/// t, the share of the way from `last` to `other`; `before`: x₃.
template <typename S>
constexpr S share_to_zero(const Place<S>& last, const Place<S>& other,
                          const Place<S>& before) noexcept {
  const S xi = (last.at - other.at) / (before.at - other.at);
  const S phi = (last.value - other.value) / (before.value - other.value);
  if (!(phi * phi < xi && (S(1) - phi) * (S(1) - phi) < S(1) - xi)) return S(0.5);
  const S first =
      last.value / (other.value - last.value) * (before.value / (other.value - before.value));
  const S second =
      last.value / (before.value - last.value) * (other.value / (before.value - other.value));
  return first + (before.at - last.at) / (other.at - last.at) * second;
}

/// f > 0 at `low`, f ≤ 0 at `high`, values given. Returns the end of a bracket that is at most
/// `tolerance` long, after 60 rounds at the latest, at which f is not above zero.
template <typename S, typename Function>
constexpr S find_zero(const Function& f, S low, S at_low, S high, S at_high, S tolerance) noexcept {
  Place<S> last{low, at_low};
  Place<S> other{high, at_high};
  S share = at_low / (at_low - at_high);
  for (int round = 0; round < 60; ++round) {
    const S length = math::absolute(other.at - last.at);
    if (!(length > tolerance) || last.value == S(0) || other.value == S(0)) break;
    const S edge = S(0.5) * tolerance / length;
    const S x = last.at + math::clamp(share, edge, S(1) - edge) * (other.at - last.at);
    const S value = f(x);
    const bool same_side = (value > S(0)) == (last.value > S(0));
    const Place<S> before = same_side ? last : other;
    if (!same_side) other = last;
    last = {x, value};
    share = share_to_zero(last, other, before);
  }
  return last.value > S(0) ? other.at : last.at;
}

}  // namespace flexspline
