/// Velocity and acceleration from an encoder, causal: what a device can run.
///
///   v ← v + g (Δq / T − v),   a ← a + g (Δv / T − a),   g = 1 − exp(−2π f T)
///
/// f is the corner (−3 dB) of each first-order stage. A steady velocity is exact. Late by
/// T/(e^(2π f T) − 1) + T/2 in velocity, which is 1/(2π f) but for (2π f T)² / 12 of it, and by
/// twice that in acceleration. Positions are differences of integers, so a far turn costs no
/// digits; a step of half a turn or more is taken the short way. The first sample starts at
/// rest; a sample with a bad period, or with one so short that the velocity is not finite,
/// changes nothing.
#pragma once

#include "flexspline/angle.hpp"

namespace flexspline {

template <typename S>
struct Differentiator {
  struct Config {
    S bandwidth = S(20);  ///< Hz, > 0
  };
  struct State {
    Phase<S> last;
    S velocity = 0;      ///< rad/s
    S acceleration = 0;  ///< rad/s²
    bool started = false;
  };

  static constexpr Status step(const Config& config, State& state, Phase<S> position,
                               S period) noexcept {
    if (!math::is_finite(period) || !(period > S(0))) return Status::bad_period;
    if (!state.started) {
      state = {position, S(0), S(0), true};
      return Status::ok;
    }
    const S gain = -math::decayed(S(2) * math::pi<S> * config.bandwidth * period);
    const S moved = S(2) * math::pi<S> * (position - state.last).shortest();
    const S gained = gain * (moved / period - state.velocity);
    const S velocity = state.velocity + gained;
    const S acceleration = state.acceleration + gain * (gained / period - state.acceleration);
    if (!math::is_finite(velocity) || !math::is_finite(acceleration)) return Status::not_finite;
    state = {position, velocity, acceleration, true};
    return Status::ok;
  }
};

}  // namespace flexspline
