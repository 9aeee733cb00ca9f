/// Torque from how fast the gear twists: structural damping.
///
///   τ = τ_0 + y,     T ẏ = −B Δθ̇_m − y,     y = 0 at the first sample
///
/// The rate of the torsion, low-passed with the time constant T and times a damping B. That is
/// the same as a spring B/T on what a first-order high pass with the same T leaves of the
/// torsion: a push is seen when it comes and forgotten after some T, so slow errors of the
/// torsion (temperature, a wrong zero) do no harm, and a torque that is held fades to τ_0: the
/// method is biased where torque is held. Below `threshold` the rate counts as zero.
///
/// Sign: τ is positive outward, and an outward torque makes Δθ_m = Δθ / Ñ negative. The step is
/// exact for a rate that is constant over the period. A bad period or a value that is not finite
/// changes nothing.
/// Source: a reading. full_range_torque_estimation names the method sd and gives only its ref. 23
/// [Ismail2021], which we have not seen. Its abstract says "structural damping",
/// "linear dynamic model" and "torsional rate"; the formula, τ = τ_0 + B Δθ̇ under a low pass with a
/// time constant T and a threshold on Δθ, is as the repository allwinlucious/MasterThesis quotes it
/// (chapter 2, eq. 2.2).
#pragma once

#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename S>
struct StructuralDamping {
  struct Config {
    S damping = 0;         ///< B, Nm·s/rad at the output, > 0
    S time_constant = 1;   ///< T, s, > 0
    S initial_torque = 0;  ///< τ_0, Nm
    S threshold = 0;       ///< rad at the output, ≥ 0; a smaller torsion has no rate
  };
  struct State {
    S torsion = 0;  ///< of the last sample, rad
    S passed = 0;   ///< y, Nm
    bool started = false;
  };

  /// `torsion`: Δθ_m, rad at the output; `period`: s since the last sample; `torque`: Nm, outward.
  static constexpr Status step(const Config& config, State& state, S torsion, S period,
                               S& torque) noexcept {
    if (!math::is_finite(torsion)) return Status::not_finite;
    if (!state.started) {
      state = {torsion, S(0), true};
      torque = config.initial_torque;
      return Status::ok;
    }
    if (!math::is_finite(period) || !(period > S(0))) return Status::bad_period;
    const bool small = math::absolute(torsion) < config.threshold;
    const S rate = small ? S(0) : (torsion - state.torsion) / period;
    const S gain = -math::expm1_negative(period / config.time_constant);
    const S passed = state.passed + gain * (-config.damping * rate - state.passed);
    if (!math::is_finite(passed)) return Status::not_finite;
    state = {torsion, passed, true};
    torque = config.initial_torque + passed;
    return Status::ok;
  }
};

}  // namespace flexspline
