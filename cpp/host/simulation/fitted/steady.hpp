/// What of friction needs no evaluation on the way.
///
/// Once the direction has its limit, v_d → 0, some effects depend on the direction and the load
/// alone: coulomb_friction, load_dependent_friction, the offset. Their rows are read once, and are
/// found to be straight lines of the load on either side of zero:
///
///   τ = constant + |load| · (above or below)
///
/// which also lets the load's own q̈ be solved for.
#pragma once

#include <optional>

#include "host/simulation/common/equation_of_motion.hpp"
#include "host/simulation/fitted/member.hpp"

namespace flexspline::batch::forward {

/// Torque of such effects together, in one direction of motion.
struct Steady {
  double constant = 0;                      ///< Nm
  double above = 0;                         ///< Nm for each Nm of a positive load
  double below = 0;                         ///< Nm for each Nm of a negative load
  double share_above = 1, share_below = 1;  ///< of the load in what solves for it; see prepare

  Steady& operator+=(const Steady& other) noexcept {
    constant += other.constant;
    above += other.above;
    below += other.below;
    return *this;
  }
  double at(double load) const noexcept {
    return constant + (load > 0 ? above * load : -below * load);
  }
  /// The load L that solves L + at(L) = sum; there is one where above > −1 and below < 1.
  double load_of(double sum) const noexcept {
    const double rest = sum - constant;
    return rest * (rest > 0 ? share_above : share_below);
  }
  /// Before load_of.
  void prepare() noexcept {
    share_above = simulation::loaded_inverse(1, 1, above, 1);
    share_below = simulation::loaded_inverse(1, 1, below, -1);
  }
};

/// For motion backward and forward.
using BothWays = std::array<Steady, 2>;

inline double torque_at(const Member& member, double velocity, double load,
                        double known_load) noexcept {
  Sample<double> at;
  at.output_velocity = velocity;
  at.load = load;
  at.known_load = known_load;
  Memories none{};
  return torque_of(member, at, none);
}

/// Whether the torque is the same at other loads: such an effect reads the known load.
inline bool blind_to_load(const Member& member) noexcept {
  return torque_at(member, 1, 5, 3) == torque_at(member, 1, -700, 3);
}

/// The effect as lines of the load, where it is made of them.
inline std::optional<BothWays> steady(const Member& member) noexcept {
  for (std::size_t k = 0; k < channel_names.size(); ++k) {
    const auto other = static_cast<Channel>(k);
    if (other == Channel::output_velocity || other == Channel::load) continue;
    if (reads_channel(member.effect, other)) return std::nullopt;
  }
  BothWays found;
  for (const int way : {0, 1}) {
    const double sign = 2 * way - 1;
    Steady& s = found[static_cast<std::size_t>(way)];
    s.constant = torque_at(member, sign * still, 0, 0);
    s.above = torque_at(member, sign * still, 1, 0) - s.constant;
    s.below = torque_at(member, sign * still, -1, 0) - s.constant;
    for (const double speed : {still, 0.37, 41.0}) {
      for (const double load : {-2000.0, -3.0, 0.0, 0.25, 700.0}) {
        const double torque = torque_at(member, sign * speed, load, 7);
        const double gap = math::absolute(torque - s.at(load));
        if (!(gap <= 1e-12 * (math::absolute(torque) + math::absolute(s.constant)))) {
          return std::nullopt;
        }
      }
    }
  }
  return found;
}

}  // namespace flexspline::batch::forward
