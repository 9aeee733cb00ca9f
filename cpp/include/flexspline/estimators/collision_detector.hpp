/// Contact: an external torque outside of what free motion explains.
///
///   begins   τ > positive[b]  or  τ < −negative[b],    b: the band of |q̇|
///   ends     when τ has been within release · threshold for the hold time
///
/// Band b holds speeds from edge b − 1 (included) to edge b. The release ratio keeps a torque that
/// hovers at the threshold from chattering, the hold time keeps one push from being counted twice;
/// neither delays the detection. With release 1, hold 0, one band and equal thresholds this is the
/// paper's |r| > Υ. A sample that is refused changes nothing; the next period is then longer.
/// Source: zhang_disturbance_elimination (22): 0.03 Nm, from 0.0255 Nm in free motion. Directions,
/// speed bands, release and hold are the step beyond it.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "flexspline/each_place.hpp"
#include "flexspline/fields.hpp"
#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename S>
struct ContactState {
  S calm = 0;  ///< s since the torque is within the release thresholds
  bool contact = false;
};

template <typename S, std::size_t Bands = 8>
struct CollisionDetector {
  static_assert(Bands > 0);

  using State = ContactState<S>;
  struct Config {
    using Estimator = CollisionDetector;

    std::array<S, Bands> negative{};  ///< Nm, > 0, a threshold for each band, inward torque
    std::array<S, Bands> positive{};  ///< Nm, > 0, outward torque
    std::array<S, Bands - 1> speed_edges = no_edges();  ///< rad/s, rising; unused ones infinite
    S release = S(1);                                   ///< in (0, 1]
    S hold = 0;                                         ///< s, ≥ 0

    static constexpr auto fields() noexcept {
      return std::tuple{
          Field{"negative", "Nm, by bands of speed", &Config::negative, not_negative<S>},
          Field{"positive", "Nm, by bands of speed", &Config::positive,
                flexspline::not_negative<S>},
          Field{"speed_edges", "rad/s, between the bands", &Config::speed_edges, edge<S>},
          Field{"release", "", &Config::release, part_of_one<S>},
          Field{"hold", "s", &Config::hold, not_negative<S>}};
    }
  };
  /// `residual`: external torque, Nm; `velocity`: rad/s at the output; `period`: s since the last
  /// good sample.
  static constexpr Status step(const Config& config, State& state, S residual, S velocity, S period,
                               bool& contact) noexcept {
    if (!math::is_positive(period)) return Status::bad_period;
    return advance(config, state, residual, velocity, period, contact);
  }

  /// The same for a period that is known to be good.
  static constexpr Status advance(const Config& config, State& state, S residual, S velocity,
                                  S period, bool& contact) noexcept {
    if (!math::is_finite(residual) || !math::is_finite(velocity)) return Status::not_finite;
    const std::size_t b = band(config, velocity);
    const S ratio = state.contact ? config.release : S(1);
    const bool outside =
        residual > ratio * config.positive[b] || residual < -ratio * config.negative[b];
    const S calm = outside ? S(0) : state.calm + period;
    const bool held = state.contact && calm < config.hold;
    state = {calm, outside || held};
    contact = state.contact;
    return Status::ok;
  }

 private:
  static constexpr std::array<S, Bands - 1> no_edges() noexcept {
    std::array<S, Bands - 1> edges{};
    for (S& edge : edges) edge = std::numeric_limits<S>::infinity();
    return edges;
  }
  static constexpr std::size_t band(const Config& config, S velocity) noexcept {
    const S speed = math::absolute(velocity);
    std::size_t b = 0;
    for_each_place<Bands - 1>([&](std::size_t k) { b += speed >= config.speed_edges[k] ? 1 : 0; });
    return b;
  }
};

}  // namespace flexspline
