/// Torque through a gear that twists, from its torsion: a torsion model the other way round.
///
///   τ:  y(τ) = Δθ,      y(τ) = Σ row_i · coefficients_i   at the load τ and τ_m = τ/Ñ,  |τ| ≤ τ_x
///                       y(τ) = y(±τ_x) − s (τ ∓ τ_x)      beyond
///
/// Springs, backlash and hysteresis lie in series: one torque passes them all, and what they twist
/// adds up. The wave generator gets its Ñth part, without what turns or brakes the motor.
///
/// y falls with τ by at least s per Nm, also just behind a reversal, where all of a loop sticks: who
/// sets a coupling up sees to that, and to loops whose coefficients are ≥ 0. Then there is one τ for
/// each Δθ, the stiffness dτ/d(Δθ/Ñ) is nowhere above Ñ/s, and no motion gets more work out of the
/// coupling than was put in: of a spring in series with plays, ∫ τ d(−Δθ/Ñ) ≥ 0 from rest.
///
/// τ is found (find_zero.hpp) to sixteen units in the last place of τ_x, from the one of the step
/// before; that takes some six evaluations of the model, and never more than 123. The memory of
/// the model moves on by one sample with the load that was found.
#pragma once

#include <limits>

#include "flexspline/find_zero.hpp"
#include "flexspline/model.hpp"

namespace flexspline {

template <typename S>
struct Coupling {
  S ratio = 1;             ///< Ñ, > 0
  S largest_load = 1;      ///< τ_x, Nm at the output, > 0: as far as the model is trusted
  S least_compliance = 1;  ///< s, rad at the motor per Nm at the output, > 0

  /// Largest stiffness between both sides, Nm/rad at the output.
  constexpr S stiffness() const noexcept { return ratio / least_compliance; }

  /// `torsion` Δθ = Ñ q − θ, rad at the motor; `at`: what else the model reads, such as the
  /// temperature; `torque`: in, that of the last sample, out, τ. Where something is not finite,
  /// `torque` and `state` keep what they have.
  template <typename Model>
  constexpr Status torque(const Model& model, const Sample<S>& at, S torsion,
                          typename Model::State& state, S& torque) const noexcept {
    const S tolerance = S(16) * std::numeric_limits<S>::epsilon() * largest_load;
    const S none = tolerance * least_compliance;
    Sample<S> asked = at;
    asked.known_load = S(0);
    evaluation::prepare(model, asked);
    const auto excess = [&, carried = asked.load](S load) {
      const S within = math::clamp(load, largest_load);
      typename Model::State unused = state;
      asked.load = carried + within;
      asked.motor_torque = within / ratio;
      const S twisted = model.sum(asked, unused) - least_compliance * (load - within);
      // As y falls by s at least, what is below `none` is there.
      return math::absolute(twisted - torsion) <= none ? S(0) : twisted - torsion;
    };
    const S near = torque;
    const S at_near = excess(near);
    S reach = at_near / least_compliance;
    S at_far = excess(near + reach);
    for (int k = 0; k < most_doublings && at_near * at_far > S(0); ++k) {  // short by rounding
      reach *= S(2);
      at_far = excess(near + reach);
    }
    if (!(at_near * at_far <= S(0))) return Status::not_finite;
    S found = near + reach;
    if (at_near > S(0)) {
      found = find_zero(excess, near, at_near, near + reach, at_far, tolerance);
    } else if (at_far > S(0)) {
      found = find_zero(excess, near + reach, at_far, near, at_near, tolerance);
    }
    asked = at;
    asked.known_load = math::clamp(found, largest_load);
    asked.motor_torque = asked.known_load / ratio;
    S unneeded = 0;
    const Status status = evaluation::predict(model, asked, state, unneeded);
    if (status != Status::ok || !math::is_finite(found)) return Status::not_finite;
    torque = found;
    return Status::ok;
  }

 private:
  static constexpr int most_doublings = 60;
};

}  // namespace flexspline
