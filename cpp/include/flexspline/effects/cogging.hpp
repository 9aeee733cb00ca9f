#pragma once

#include "flexspline/effects/harmonics.hpp"

namespace flexspline {

/// Torque of the motor's magnets and slots: harmonics of the rotor's angle.
///
///   τ = Σ_k  a_k cos(k θ) + b_k sin(k θ)
///
/// Linear in a and b. Orders are multiples of pole or slot counts.
/// Source: [Madsen2020], Comprehensive modeling and identification of nonlinear joint
/// dynamics.
template <typename S, std::size_t K>
struct Cogging : Harmonics<S, K> {
  static constexpr std::string_view name = "cogging";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "periods per motor turn at multiples of poles or slots";
  static constexpr std::string_view source =
      "Madsen et al. 2020, Comprehensive modeling and identification of nonlinear joint dynamics";
  static constexpr std::array<Channel, 1> reads{Channel::motor_position};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::resolved_poles}}};
  static constexpr std::array<Pair, 1> pairs{Pair::motor_on_stator};
};

}  // namespace flexspline
