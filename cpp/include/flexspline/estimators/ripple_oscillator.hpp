/// A Kalman filter that takes ripple for a sum of oscillators turned by the joint's own angle.
///
///   state      level τ; for each order o the ripple u and its quarter-turn partner w
///   turned by  a = o Δβ:   u ← u cos a + w sin a,   w ← w cos a − u sin a
///   walks      level by level_rate² T, each u and w by ripple_rate² |Δβ|
///   measured   y = τ + Σ u + noise
///   given out  torque = y − Σ u
///
/// The angle moves the oscillators, so a speed that changes costs nothing. At standstill nothing
/// turns, level and ripple look alike, and what was learnt in motion is held: a change of load
/// then goes into the level, and the ripple's walk is per angle, so that hours at rest do not
/// undo it. A filter that has not moved yet knows no ripple. What the torque itself has at an
/// order is removed with the ripple.
/// The first sample starts the level at the reading, as uncertain as the ripple that is in it.
/// Each step must turn less than half a turn.
///
/// Source: the idea is Taghirad & Bélanger's (ref. 10 of zhang_disturbance_elimination), whose
/// ripple model this paper does not print; states and walks are ours.
#pragma once

#include <array>
#include <cstddef>

#include "flexspline/angle.hpp"

namespace flexspline {

template <typename S, std::size_t K>
struct RippleOscillator {
  static constexpr std::size_t most = 1 + 2 * K;

  struct Config {
    std::array<std::uint32_t, K> orders{};
    std::size_t count = K;     ///< orders in use
    S noise = S(0.02);         ///< of the reading, Nm, > 0
    S level_rate = S(1);       ///< Nm/√s
    S ripple_rate = S(0.001);  ///< Nm/√rad
    S amplitude = S(0.5);      ///< Nm, of a ripple before the first sample, standard deviation
  };
  struct State {
    std::array<S, most> mean{};
    std::array<std::array<S, most>, most> covariance{};
    Phase<S> last;
    bool started = false;
  };

  static constexpr Status step(const Config& config, State& state, Phase<S> angle, S reading,
                               S period, S& torque) noexcept {
    if (!math::is_finite(reading)) return Status::not_finite;
    if (!state.started) {
      start(config, state, angle, reading);
      torque = reading;
      return Status::ok;
    }
    if (!math::is_finite(period) || !(period > S(0))) return Status::bad_period;
    State next = state;
    const Phase<S> moved = angle - state.last;
    turn(config, next, moved);
    walk(config, next, S(2) * math::pi<S> * math::absolute(moved.shortest()), period);
    const S ripple = correct(config, next, reading);
    if (!math::is_finite(ripple)) return Status::not_finite;
    next.last = angle;
    state = next;
    torque = reading - ripple;
    return Status::ok;
  }

 private:
  static constexpr void start(const Config& config, State& state, Phase<S> angle,
                              S reading) noexcept {
    const S unknown = config.amplitude * config.amplitude;
    state = {};
    state.mean[0] = reading;
    state.covariance[0][0] = config.noise * config.noise + static_cast<S>(config.count) * unknown;
    for (std::size_t u = 1; u < 1 + 2 * config.count; u += 2) {
      state.covariance[u][u] = state.covariance[u + 1][u + 1] = unknown;
      state.covariance[0][u] = state.covariance[u][0] = -unknown;  // more ripple is less level
    }
    state.last = angle;
    state.started = true;
  }

  static constexpr void rotate(const math::Phasor<S>& p, S& u, S& w) noexcept {
    const S turned = u * p.cosine + w * p.sine;
    w = w * p.cosine - u * p.sine;
    u = turned;
  }

  /// Mean and covariance into the oscillators' new phases: x ← F x, P ← F P Fᵀ.
  static constexpr void turn(const Config& config, State& next, Phase<S> moved) noexcept {
    const std::size_t size = 1 + 2 * config.count;
    for (std::size_t k = 0; k < config.count; ++k) {
      const math::Phasor<S> p = (math::Bits<S>(config.orders[k]) * moved).phasor();
      const std::size_t u = 1 + 2 * k;
      rotate(p, next.mean[u], next.mean[u + 1]);
      for (std::size_t j = 0; j < size; ++j) {
        rotate(p, next.covariance[u][j], next.covariance[u + 1][j]);
      }
      for (std::size_t j = 0; j < size; ++j) {
        rotate(p, next.covariance[j][u], next.covariance[j][u + 1]);
      }
    }
  }

  static constexpr void walk(const Config& config, State& next, S travelled, S period) noexcept {
    next.covariance[0][0] += config.level_rate * config.level_rate * period;
    const S grown = config.ripple_rate * config.ripple_rate * travelled;
    for (std::size_t k = 1; k < 1 + 2 * config.count; ++k) next.covariance[k][k] += grown;
  }

  /// Takes in the reading; returns the ripple in it.
  static constexpr S correct(const Config& config, State& next, S reading) noexcept {
    const std::size_t size = 1 + 2 * config.count;
    std::array<S, most> shared{};  // P h: the level and each u are in the reading
    for (std::size_t i = 0; i < size; ++i) {
      shared[i] = next.covariance[i][0];
      for (std::size_t u = 1; u < size; u += 2) shared[i] += next.covariance[i][u];
    }
    S spread = config.noise * config.noise + shared[0];
    S expected = next.mean[0];
    for (std::size_t u = 1; u < size; u += 2) {
      spread += shared[u];
      expected += next.mean[u];
    }
    const S share = S(1) / spread;
    const S surprise = share * (reading - expected);
    for (std::size_t i = 0; i < size; ++i) {
      next.mean[i] += shared[i] * surprise;
      for (std::size_t j = 0; j < size; ++j) {
        next.covariance[i][j] -= shared[i] * (shared[j] * share);
      }
    }
    S ripple = S(0);
    for (std::size_t u = 1; u < size; u += 2) ripple += next.mean[u];
    return ripple;
  }
};

}  // namespace flexspline
