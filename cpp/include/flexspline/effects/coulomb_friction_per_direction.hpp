#pragma once

#include "flexspline/effects/effect.hpp"

namespace flexspline {

/// Coulomb friction with a level for each direction: the two sigmoids of the paper.
///
///   τ = c⁺ (1 + d(v)) / 2 + c⁻ (1 − d(v)) / 2,     d(v) = tanh(v / v_d) = 2 / (1 + e^(−α v)) − 1
///
/// At v = 0: the mean of c⁺ and c⁻. Linear in both; α = 2 / v_d.
/// The two columns add up to one at every velocity: beside an offset, only c⁺ + offset and
/// c⁻ + offset can be known.
/// Source: turlapati_intrinsic_dynamics (9).
template <typename S>
struct CoulombFrictionPerDirection {
  static constexpr std::string_view name = "coulomb_friction_per_direction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "a step in torque where the direction of motion changes, of unequal heights";
  static constexpr std::string_view source = "turlapati_intrinsic_dynamics (9)";
  static constexpr std::array<Term, 2> terms{{{"positive", "Nm"}, {"negative", "Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_velocity};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 1> demands{{{Excitation::both_directions}}};
  static constexpr std::array<std::string_view, 2> combines{"coulomb_friction", "offset"};

  S direction_width = S(0.005);  ///< rad/s, half-width of the change of direction, > 0; one for all
                                 ///< friction of a model

  static constexpr auto shapes() noexcept {
    return std::array{direction_width_shape<CoulombFrictionPerDirection, S>()};
  }

  constexpr Row<S, 2> row(const Sample<S>& at) const noexcept {
    const S d = direction(at.output_velocity, direction_width);
    return {S(0.5) + S(0.5) * d, S(0.5) - S(0.5) * d};
  }
};

}  // namespace flexspline
