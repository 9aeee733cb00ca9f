/// Observer and compliance as two measurements of one torque that wanders.
///
///   τ_k = τ_(k−1) + w,   var w = walk² T;    z_i = τ + noise of variance R_i(q̇)
///   P ← P + walk² T;  then for each:  G = P / (P + R_i),  τ ← τ + G (z_i − τ),  P ← (1 − G) P
///
/// R_i goes from its value at rest to that in motion with the logistic weight of the merge (20).
/// Two scalar updates are the whole filter. Against (19) it also smooths, and knows how far to
/// trust: P is its variance, Nm². Constant R and walk give a first-order low pass; walk → ∞ gives
/// the mean weighted by 1/R. It takes the noise for white and unbiased, which a wrong friction or
/// stiffness is not.
///
/// The first sample starts at the weighted mean of the two. A sample that is refused changes
/// nothing; the next period is then longer and P grows by it.
/// Source: a rival of full_range_torque_estimation (19) that its §II-C names; the filter is
/// Kalman's for a random walk.
#pragma once

#include "flexspline/estimators/logistic_merge.hpp"
#include "flexspline/fields.hpp"

namespace flexspline {

template <typename S>
struct KalmanMerge {
  struct Config {
    LogisticMerge<S> motion;  ///< when it moves: 0 at rest, 1 in motion
    S walk = S(10);           ///< Nm/√s, > 0: the torque wanders by this in a second
    S observer_rest = S(2);   ///< Nm, standard deviations of one sample, > 0
    S observer_motion = S(1);
    S compliance_rest = S(1);
    S compliance_motion = S(3);

    static constexpr auto fields() noexcept {
      return std::tuple{
          Field{"walk", "Nm/sqrt(s)", &Config::walk, positive<S>},
          Field{"observer_rest", "Nm", &Config::observer_rest, positive<S>, "observer_noise"},
          Field{"observer_motion", "Nm", &Config::observer_motion, positive<S>, "observer_noise"},
          Field{"compliance_rest", "Nm", &Config::compliance_rest, positive<S>, "compliance_noise"},
          Field{"compliance_motion", "Nm", &Config::compliance_motion, positive<S>,
                "compliance_noise"}};
    }
  };
  struct State {
    S torque = 0;    ///< Nm
    S variance = 0;  ///< P, Nm²
    bool started = false;
  };

  /// `velocity`: rad/s at the output; torques in Nm; `period`: s since the last good sample.
  static constexpr Status step(const Config& config, State& state, S velocity, S observer,
                               S compliance, S period, S& merged) noexcept {
    if (!math::is_positive(period)) return Status::bad_period;
    return advance(config, state, velocity, observer, compliance, period, merged);
  }

  /// The same for a period that is known to be good.
  static constexpr Status advance(const Config& config, State& state, S velocity, S observer,
                                  S compliance, S period, S& merged) noexcept {
    if (!math::is_finite(velocity)) return Status::not_finite;
    const S moving = config.motion.weight(velocity);
    const S observed = blend(config.observer_rest, config.observer_motion, moving);
    const S twisted = blend(config.compliance_rest, config.compliance_motion, moving);
    State next{observer, observed, true};
    if (state.started) {
      next = {state.torque, state.variance + config.walk * config.walk * period, true};
      update(next, observer, observed);
    }
    update(next, compliance, twisted);
    if (!math::is_finite(next.torque) || !math::is_finite(next.variance)) return Status::not_finite;
    state = next;
    merged = next.torque;
    return Status::ok;
  }

 private:
  static constexpr S blend(S rest, S motion, S moving) noexcept {
    return rest * rest + moving * (motion * motion - rest * rest);
  }
  static constexpr void update(State& state, S measured, S variance) noexcept {
    const S gain = state.variance / (state.variance + variance);
    state.torque += gain * (measured - state.torque);
    state.variance -= gain * state.variance;
  }
};

}  // namespace flexspline
