/// Torque through the gear where its torsion also remembers the way that the load came.
///
///   Δθ_m = −atan(c_m τ) / (c_m K_m0) + h(τ),     h = Σ_k  c_k z_k / w_k
///
/// h is the effect torsional_hysteresis on the path of the load: part of the torsion, and it asks
/// for the torque that is looked for. Each sample takes the same few operations:
///
///   τ⁰ = mesh(Δθ_m − h of the last sample)
///   τ  = mesh(Δθ_m − h at τ⁰)                 the estimate
///   the springs move to τ, once
///
/// The error that this leaves is ρ² of what the torque moved since the last sample, and the next
/// sample goes on from there. ρ = K Σ c_k / w_k over the springs that stick, K the mesh's stiffness
/// at τ: below one where a gear that is loaded further yields further, zero where all slip. A model
/// with ρ ≥ 1 is none of a gear, but its torque stays bounded: |h| ≤ Σ |c_k|.
///
/// The first sample starts in the middle of the loop, h = 0, which is a guess. The path is this
/// torque alone, also in a joint with a sensor: sensor and compliance stay two witnesses. A torque
/// that is held at the pole is no measurement: it is given and flagged, the springs stay. So they
/// do where the torsion is not finite.
/// Source: full_range_torque_estimation (14), (18); the loop is the step beyond it.
#pragma once

#include "flexspline/estimators/compliance.hpp"
#include "flexspline/fields.hpp"
#include "flexspline/maxwell_slip.hpp"

namespace flexspline {

template <typename S>
struct LoadHysteresis {
  using Elements = MaxwellSlip<S, 4>;

  S load_width = S(10);        ///< w, Nm at the output, > 0
  std::array<S, 4> heights{};  ///< c_k of w, w/2, w/4, w/8; rad at the output side

  static constexpr auto fields() noexcept {
    return std::tuple{
        Field{"load_width", "Nm", &LoadHysteresis::load_width, positive<S>},
        Field{"heights", "rad at the output, of the width, its half, quarter and eighth",
              &LoadHysteresis::heights, finite<S>}};
  }

  struct State {
    typename Elements::State elements;
    S torque = 0;  ///< Nm, to which the springs moved last, on their grid
    S loop = 0;    ///< h there, rad at the output side
  };

  /// `torsion` Δθ_m, rad at the output side; `left`: that of the mesh alone.
  constexpr Status torque(const Compliance<S>& mesh, State& state, S torsion, S& left,
                          FlaggedTorque<S>& out) const noexcept {
    FlaggedTorque<S> found;
    const Status first = mesh.torque(torsion - state.loop, found);
    if (first != Status::ok) return first;
    const S rest = torsion - moved(state, found.torque).loop;
    const Status second = mesh.torque(rest, found);
    if (second != Status::ok) return second;
    left = rest;
    out = found;
    if (!has(found.flags, Flag::saturated)) state = moved(state, found.torque);
    return Status::ok;
  }

 private:
  constexpr State moved(State state, S torque) const noexcept {
    const S place = Elements::on_grid(torque, load_width);
    Elements::step(state.elements, place - state.torque, load_width);
    const Row<S, 4> shares = Elements::shares(state.elements, load_width);
    return {state.elements, place, weighted<S>(shares, heights)};
  }
};

}  // namespace flexspline
