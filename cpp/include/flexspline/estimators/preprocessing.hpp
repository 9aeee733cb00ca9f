/// Readings on their way into the chain: what cannot be true is taken out, and velocity and
/// acceleration that the device has no channel for come from the angle.
///
///   checks          reading_checks.hpp
///   differentiator  estimators/differentiator.hpp; what it makes replaces what was read
///
/// Both run where they are given (stages.hpp). The differentiator misses a sample, which then has
/// no velocity, acceleration, or both,
///
///   - at a start, until the filter has forgotten it to a thousandth: 7 / (2π f) after the first
///     angle, 56 ms at 20 Hz. The velocity between the first two angles is what it starts from,
///     unless that is faster than any joint: an absurd period would else be remembered for seconds.
///   - while the angle is missing; the difference behind is over the longer time
///   - with the first angle behind one that the checks took out; the way between them is not
///     counted, and the filter goes on from the velocity that it had
///
/// A gap of more than 7 / (2π f) is a start: of what was before, the filter knows nothing any more.
#pragma once

#include "flexspline/estimators/stages.hpp"

namespace flexspline {

template <typename S>
struct Preprocessing {
  using Checks = ReadingChecks<S>;
  using Filter = Differentiator<S>;

  static constexpr S forgotten = S(7);    ///< 2π f t, after which e^−7 of a start is left
  static constexpr S fastest = S(10000);  ///< rad/s that a start takes for a velocity

  struct State {
    typename Checks::State checks;
    typename Filter::State filter;
    S wait = 0;         ///< s since the last angle
    S age = 0;          ///< 2π f t since the start, up to `forgotten`
    bool lost = false;  ///< an angle was taken out since the last good one
  };

  /// Readings whose period is good. `Output`: that of the chain; adds to its faults.
  template <typename Stages, typename Output>
  static constexpr void step(const Stages& stages, State& state, Reading<S>& in,
                             Output& out) noexcept {
    const auto* filter = given(stages.differentiator);
    if (filter) put(filter->makes, Reading<S>::missing, Reading<S>::missing, in);
    if (const auto* checks = given(stages.checks)) {
      const bool had = in.output_position.has_value();
      out.faults = out.faults | Checks::advance(*checks, state.checks, in);
      if (had && !in.output_position) [[unlikely]]
        state.lost = true;
    }
    if (!filter) return;
    if (!moves(*filter, state, in)) [[unlikely]] {
      out.missed = out.missed | Stage::differentiator;
      return;
    }
    put(filter->makes, state.filter.velocity, state.filter.acceleration, in);
  }

  /// What two witnesses say of each other, behind the chain.
  template <typename Stages, typename Output>
  static constexpr void compare(const Stages& stages, Output& out) noexcept {
    if (const auto* checks = given(stages.checks)) {
      out.faults = out.faults | Checks::torques(*checks, out);
    }
  }

 private:
  static constexpr void put(Derivatives made, S velocity, S acceleration, Reading<S>& in) noexcept {
    if (made != Derivatives::acceleration) in.output_velocity = velocity;
    if (made != Derivatives::velocity) in.output_acceleration = acceleration;
  }

  /// Whether the filter has a velocity for this sample.
  static constexpr bool moves(const typename Filter::Config& config, State& state,
                              const Reading<S>& in) noexcept {
    state.wait += in.period;
    if (!in.output_position) [[unlikely]]
      return false;
    const Phase<S> at = in.output_position->phase;
    const S passed = Filter::radians * config.bandwidth * state.wait;
    if (!state.filter.started || state.lost || !(passed < forgotten)) [[unlikely]] {
      anchor(state, at, passed);
      return false;
    }
    if (!(state.age > S(0))) [[unlikely]] {
      const S between = Filter::radians * (at - state.filter.last).shortest() / state.wait;
      if (!(math::absolute(between) <= fastest)) {
        anchor(state, at, passed);
        return false;
      }
      state.filter.velocity = between;
    }
    if (Filter::advance(config, state.filter, at, state.wait) != Status::ok) [[unlikely]]
      return false;
    state.wait = S(0);
    if (state.age < forgotten) [[unlikely]]
      state.age = state.age + passed;
    return !(state.age < forgotten);
  }

  /// An angle that nothing is compared with: of a start, or behind one that was taken out.
  static constexpr void anchor(State& state, Phase<S> at, S passed) noexcept {
    if (!state.filter.started || !(passed < forgotten)) {
      state.filter.velocity = state.filter.acceleration = S(0);
      state.age = S(0);
    }
    state.filter.last = at;
    state.filter.started = true;
    state.lost = false;
    state.wait = S(0);
  }
};

}  // namespace flexspline
