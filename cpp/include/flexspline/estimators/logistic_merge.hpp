/// The observer in motion, the compliance at standstill: a mean whose weight follows the speed.
///
///   λ(q̇) = 1 / (1 + e^(−α (|q̇| − q̇_trans))),     τ = λ τ_observer + (1 − λ) τ_compliance
///
/// At |q̇| = q̇_trans: one half. At rest: 1 / (1 + e^(α q̇_trans)), which is 0.378 for the paper's m1
/// (500 s/rad, 0.001 rad/s): at standstill 38 % of that estimate is still the observer. Both
/// torques are positive outward here; (8) and (18) as printed have opposite signs, and (19) would
/// cancel one push.
/// Source: full_range_torque_estimation (19), (20).
#pragma once

#include "flexspline/fields.hpp"
#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename S>
struct LogisticMerge {
  S alpha = S(500);                   ///< α, s/rad at the output, > 0
  S transition_velocity = S(0.001L);  ///< q̇_trans, rad/s at the output, ≥ 0

  static constexpr auto fields() noexcept {
    return std::tuple{Field{"alpha", "s/rad", &LogisticMerge::alpha, positive<S>},
                      Field{"transition_velocity", "rad/s", &LogisticMerge::transition_velocity,
                            not_negative<S>}};
  }

  /// λ: the share of the observer. NaN in gives NaN out.
  constexpr S weight(S velocity) const noexcept {
    return S(1) / (S(1) + math::exp(alpha * (transition_velocity - math::absolute(velocity))));
  }

  /// Torques in Nm; `weight` and `merged` keep their values where the step is refused.
  constexpr Status merge(S velocity, S observer, S compliance, S& weight,
                         S& merged) const noexcept {
    if (!math::is_finite(velocity)) return Status::not_finite;
    return advance(velocity, observer, compliance, weight, merged);
  }

  /// The same for a velocity that is not infinite.
  constexpr Status advance(S velocity, S observer, S compliance, S& weight,
                           S& merged) const noexcept {
    const S share = this->weight(velocity);
    const S found = compliance + share * (observer - compliance);
    if (!math::is_finite(found)) return Status::not_finite;
    weight = share;
    merged = found;
    return Status::ok;
  }
};

}  // namespace flexspline
