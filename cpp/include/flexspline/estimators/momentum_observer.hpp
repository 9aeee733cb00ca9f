/// External torque from momentum, without an acceleration.
///
///   ṗ = τ̄ − τ_ext,    p = J q̇,    ṙ = K (τ_ext − r)
///
/// r is the estimate: the external torque, positive outward, behind a first-order low pass with a
/// corner of K/2π Hz. τ̄ is what else drives the momentum: the sensor's torque, or Ñ τ_m, less
/// friction, gravity and what is known of the load. Over a period T the mean external torque is
///
///   e = τ̄ − Δp / T,    r ← r + share (e − r)
///
///   exact   share = 1 − e^(−K T), τ̄ the mean of its last two values: no error for an external
///           torque that is constant over each period, stable for every K T > 0
///   euler   share = K T, τ̄ of the last sample: the papers' integral by forward Euler; dead-beat at
///           K T = 1, rings for ever at 2; refused from there on
///
/// The first sample starts at r = 0, whatever the momentum: no jump. A sample that is refused
/// changes nothing; the next period is then longer and nothing is lost but time. A gain that is not
/// above zero, or Euler with K T ≥ 2: `out_of_range`; where that is one long gap, set `started` to
/// false: the next sample starts again from the r that there is. n joints are n of these, each with
/// its row of M q̇ and of Cᵀ q̇ in τ̄.
/// Source: zhang_disturbance_elimination (17)–(21), full_range_torque_estimation (7), (8). Signs:
/// τ_c and r of the former are positive when the outside drives the joint. The latter's gains, −8
/// in the text, 80 in Table II, "discrete time gain", diverge as printed in (7), (8); 80 1/s at
/// 500 Hz is a reading that is stable.
#pragma once

#include "flexspline/fields.hpp"
#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

enum class Discretisation : unsigned char { exact, euler };

template <typename S>
struct MomentumObserver {
  struct Config {
    S gain = S(100);  ///< K, 1/s, > 0
    Discretisation discretisation = Discretisation::exact;

    static constexpr auto fields() noexcept {
      return std::tuple{Field{"gain", "1/s", &Config::gain, positive<S>}};
    }
    static constexpr auto rules() noexcept {
      return std::tuple{Rule{"discretisation", "Discretisation", &Config::discretisation,
                             std::array<std::string_view, 2>{"exact", "euler"}}};
    }
  };
  struct State {
    S momentum = 0;      ///< of the last good sample, Nm s
    S known_torque = 0;  ///< of the last good sample, Nm
    S external = 0;      ///< r, Nm
    S decay = 0;         ///< K T that `share` was computed from; 0: none
    S share = 0;         ///< kept, as periods seldom change
    bool started = false;
  };

  /// `momentum` p, Nm s at the output; `known_torque` τ̄, Nm; `period`: s since the last good
  /// sample; `external`: Nm, outward.
  static constexpr Status step(const Config& config, State& state, S momentum, S known_torque,
                               S period, S& external) noexcept {
    if (!math::is_positive(period)) return Status::bad_period;
    return advance(config, state, momentum, known_torque, period, external);
  }

  /// The same for a period that is known to be good.
  static constexpr Status advance(const Config& config, State& state, S momentum, S known_torque,
                                  S period, S& external) noexcept {
    const bool exact = config.discretisation == Discretisation::exact;
    const S decay = config.gain * period;
    const bool stable = exact || !state.started || decay < S(2);
    if (!(config.gain > S(0)) || !stable) return Status::out_of_range;
    S found = state.external;
    if (exact && decay != state.decay) [[unlikely]] {
      state.decay = decay;
      state.share = -math::expm1_negative(decay);
    }
    if (state.started) {
      const S last = state.known_torque;
      const S driven = exact ? S(0.5) * (last + known_torque) : last;
      const S seen = driven - (momentum - state.momentum) / period;
      found += (exact ? state.share : decay) * (seen - found);
    }
    const bool shows = exact && state.started;  // in `found`, where an input is not finite
    if (!shows && !math::is_finite(momentum + known_torque)) return Status::not_finite;
    if (!math::is_finite(found)) return Status::not_finite;
    state.momentum = momentum;
    state.known_torque = known_torque;
    state.started = true;
    external = state.external = found;
    return Status::ok;
  }
};

}  // namespace flexspline
