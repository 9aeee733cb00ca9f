/// Torque through the gear from how far its mesh is twisted.
///
///   τ = −tan(c_m K_m0 Δθ_m) / c_m,     Δθ_m = (Δθ − θ_err − Δθ_w) / Ñ
///
/// The kinematic error and the wave generator's torsion are taken off before: they are effects of
/// the model's torsion part. Good at standstill, where friction blinds the observer. Beyond the
/// margin before the pole of the tangent: held and `saturated`, with the right sign. Formula, signs
/// and what the paper's text has otherwise: gear_compliance.hpp. The external torque is this less
/// what is known of it: load, gravity, inertia (17).
/// Source: full_range_torque_estimation (14), (17), (18).
#pragma once

#include "flexspline/fields.hpp"
#include "flexspline/gear_compliance.hpp"

namespace flexspline {

template <typename S>
struct Compliance {
  S mesh_stiffness = S(15548);  ///< K_m0, Nm/rad at the output, > 0
  S mesh_shape = S(0.0487L);    ///< c_m, 1/Nm, ≥ 0
  S margin = S(0.05L);          ///< share of the way to the pole kept free, in (0, 1)

  static constexpr auto fields() noexcept {
    return std::tuple{
        Field{"mesh_stiffness", "Nm/rad at the output", &Compliance::mesh_stiffness, positive<S>},
        Field{"mesh_shape", "1/Nm", &Compliance::mesh_shape, not_negative<S>},
        Field{"margin", "", &Compliance::margin, part_of_one<S>}};
  }

  /// `torsion` Δθ_m, rad at the output side.
  constexpr Status torque(S torsion, FlaggedTorque<S>& out) const noexcept {
    const FlaggedTorque<S> found = twisted(torsion);
    if (!math::is_finite(torsion) || !math::is_finite(found.torque)) return Status::not_finite;
    out = found;
    return Status::ok;
  }

  /// The same, NaN where the torsion is NaN; it is not infinite.
  constexpr FlaggedTorque<S> twisted(S torsion) const noexcept {
    return mesh_torque(torsion, mesh_stiffness, mesh_shape, margin);
  }
};

}  // namespace flexspline
