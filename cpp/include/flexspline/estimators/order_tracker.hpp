/// Order tracking: the reading resampled over angle, the orders taken out there, and back.
///
///   r_j    reading at grid angle 2π j/M, newest, from the two samples on either side
///   clean  r_j − Σ_d w_d r_{j+d},     w_d = 2/M Σ_o cos(2π o d/M)
///
/// The sum over the last turn is the Fourier part at the orders, so these leave exactly and a
/// steady torque passes. A torque that changes within a turn leaks into the orders and comes out
/// distorted until a turn later. Between grid angles the last clean value is held, and so it is
/// at standstill: NO change of torque is seen until the joint turns on by 1/M of a turn. Until a
/// whole turn has been seen the reading passes as it is. Works backward too: the grid is of
/// angles, not of time. Each step must turn less than half a turn; orders are below M/2.
/// Source: the idea is Jung's (ref. 11 of zhang_disturbance_elimination: "only applicable when the
/// position changes"); the causal form is ours.
#pragma once

#include <array>
#include <cstddef>

#include "flexspline/angle.hpp"

namespace flexspline {

template <typename S, std::size_t M>
struct OrderTracker {
  struct Config {
    std::array<S, M> weights{};  ///< w, from `config_of`
    std::size_t points = M;      ///< grid angles a turn, ≤ M
  };
  struct State {
    std::array<S, M> readings{};
    std::array<bool, M> seen{};
    std::size_t known = 0;  ///< how many grid angles have been seen
    Phase<S> last;
    S reading = 0;  ///< Nm, of the last sample
    S clean = 0;    ///< Nm, held
    bool started = false;
  };

  template <std::size_t K>
  static constexpr Config config_of(const std::array<std::uint32_t, K>& orders, std::size_t count,
                                    std::size_t points) noexcept {
    Config config;
    config.points = points;
    for (std::size_t d = 0; d < points; ++d) {
      const auto angle = Angle<S>::from_turns(static_cast<S>(d) / static_cast<S>(points));
      for (std::size_t k = 0; k < count; ++k) {
        config.weights[d] += (math::Bits<S>(orders[k]) * angle.phase).phasor().cosine;
      }
      config.weights[d] *= S(2) / static_cast<S>(points);
    }
    return config;
  }

  static constexpr Status step(const Config& config, State& state, Phase<S> angle, S reading,
                               S& torque) noexcept {
    if (!math::is_finite(reading)) return Status::not_finite;
    if (state.started) {
      const std::size_t line = resample(config, state, angle, reading);
      const bool whole = state.known == config.points;
      if (whole && line < config.points) state.clean = cleaned(config, state, line);
      if (!whole) state.clean = reading;
    } else {
      state.started = true;
      state.clean = reading;
    }
    state.last = angle;
    state.reading = reading;
    torque = state.clean;
    return Status::ok;
  }

 private:
  /// Where an angle lies on the grid: whole line below it.
  static constexpr std::size_t line_below(Phase<S> angle, std::size_t points) noexcept {
    const auto fraction = std::uint64_t(angle.fraction) << (64 - 8 * sizeof(S));
    return static_cast<std::size_t>(multiply_high(fraction, points));
  }

  /// Fills in the grid angles between the last sample and this; returns the last one of them,
  /// or `points` where none was passed.
  static constexpr std::size_t resample(const Config& config, State& state, Phase<S> angle,
                                        S reading) noexcept {
    const std::size_t points = config.points;
    const S moved = (angle - state.last).shortest() * static_cast<S>(points);
    const bool forward = moved > S(0);
    const std::size_t from = line_below(state.last, points);
    const std::size_t to = line_below(angle, points);
    const std::size_t passed = (forward ? points + to - from : points + from - to) % points;
    // the first line on the way, and how far it is, in lines
    std::size_t line = forward ? (from + 1) % points : from;
    const S turns = static_cast<S>(line) / static_cast<S>(points);
    const Phase<S> start = Angle<S>::from_turns(turns).phase;
    S away = (start - state.last).shortest() * static_cast<S>(points);
    std::size_t last = points;
    for (std::size_t k = 0; k < passed; ++k) {
      const S share = math::clamp(away / moved, S(0), S(1));
      state.readings[line] = state.reading + share * (reading - state.reading);
      state.known += state.seen[line] ? 0 : 1;
      state.seen[line] = true;
      last = line;
      line = forward ? (line + 1) % points : (line + points - 1) % points;
      away += forward ? S(1) : S(-1);
    }
    return last;
  }

  static constexpr S cleaned(const Config& config, const State& state, std::size_t line) noexcept {
    S ripple = S(0);
    for (std::size_t d = 0; d < config.points; ++d) {
      const std::size_t at = line + d < config.points ? line + d : line + d - config.points;
      ripple += config.weights[d] * state.readings[at];
    }
    return state.readings[line] - ripple;
  }
};

}  // namespace flexspline
