#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/gear_compliance.hpp"

namespace flexspline {

/// Torsion of the tooth mesh under the transmitted torque; it stiffens as the torque grows.
///
///   Δθ = −c · atan(c_m τ) / c_m,     c = Ñ / K_m0
///
/// At τ = 0: 0, with slope −c. Far above 1/c_m: ∓c π/(2 c_m). Odd in τ. Linear in c. Outward torque
/// lets the motor side run ahead, so Δθ = q Ñ − θ is negative: (15) counts its torque the other
/// way round.
/// Source: full_range_torque_estimation (14), (15).
template <typename S>
struct MeshCompliance {
  static constexpr std::string_view name = "mesh_compliance";
  static constexpr std::string_view targets = "D";
  static constexpr std::string_view signature =
      "the torsion follows the load, less where it is high";
  static constexpr std::string_view source = "full_range_torque_estimation (14), (15)";
  static constexpr std::array<Term, 1> terms{{{"compliance", "rad/Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::load};
  static constexpr Traits traits{.one_signed = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::known_load}}};

  S mesh_shape = S(0.05);  ///< c_m, 1/Nm at the output, > 0

  static constexpr auto shapes() noexcept {
    return std::array{Shape<MeshCompliance, S>{"mesh_shape", "1/Nm", &MeshCompliance::mesh_shape,
                                               S(1e-4), S(10), true}};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {mesh_torsion(at.load, S(1), mesh_shape)};
  }
};

}  // namespace flexspline
