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
#include "flexspline/fields.hpp"

namespace flexspline {

/// Which of them.
enum class Derivatives : unsigned char { velocity, acceleration, both };

template <typename S>
struct Differentiator {
  static constexpr S radians = S(2) * math::pi<S>;

  struct Config {
    S bandwidth = S(20);  ///< Hz, > 0
    Derivatives makes = Derivatives::both;

    static constexpr auto fields() noexcept {
      return std::tuple{Field{"bandwidth", "Hz, -3 dB", &Config::bandwidth, positive<S>}};
    }
    static constexpr auto rules() noexcept {
      return std::tuple{Rule{"makes", "Derivatives", &Config::makes,
                             std::array<std::string_view, 3>{"velocity", "acceleration", "both"}}};
    }
  };
  struct State {
    Phase<S> last;
    S velocity = 0;      ///< rad/s
    S acceleration = 0;  ///< rad/s²; 0 where the velocity alone is made
    bool started = false;
    S decay = 0;  ///< 2π f T that `gain` was computed from; 0: none
    S gain = 0;   ///< kept, as periods seldom change
  };

  static constexpr Status step(const Config& config, State& state, Phase<S> position,
                               S period) noexcept {
    if (!math::is_finite(period) || !(period > S(0))) return Status::bad_period;
    if (!state.started) {
      state.last = position;
      state.velocity = state.acceleration = S(0);
      state.started = true;
      return Status::ok;
    }
    return advance(config, state, position, period);
  }

  /// The same for a period that is known to be good, in a filter that has started.
  static constexpr Status advance(const Config& config, State& state, Phase<S> position,
                                  S period) noexcept {
    const S decay = radians * config.bandwidth * period;
    if (decay != state.decay) [[unlikely]] {
      state.gain = -math::expm1_negative(decay);
      state.decay = decay;
    }
    const S moved = radians * (position - state.last).shortest();
    const S gained = state.gain * (moved / period - state.velocity);
    const S velocity = state.velocity + gained;
    S acceleration = S(0);
    if (config.makes != Derivatives::velocity) {
      acceleration = state.acceleration + state.gain * (gained / period - state.acceleration);
    }
    if (!math::is_finite(velocity) || !math::is_finite(acceleration)) return Status::not_finite;
    state.last = position;
    state.velocity = velocity;
    state.acceleration = acceleration;
    return Status::ok;
  }
};

}  // namespace flexspline
