#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/maxwell_slip.hpp"

namespace flexspline {

/// Friction that is elastic before it slips: after a reversal it builds up along the way.
///
///   τ = Σ_k  c_k z_k / w_k     on the path of the joint angle q, widths w_k in rad at the output
///
/// z_k: four springs that slip at w, w/2, w/4, w/8 (see MaxwellSlip). Linear in c: each one's share
/// of the level, ≥ 0 where friction brakes. Once all slip, the sum is the level of
/// coulomb_friction, which then takes what does not build up. At rest the springs stay as they are:
/// friction holds. Steps of q are taken the short way, so it must turn less than half a turn
/// between samples.
/// Source: [AlBender2005], The generalized Maxwell-slip model.
template <typename S>
struct PreslidingFriction {
  using Elements = MaxwellSlip<S, 4>;

  static constexpr std::string_view name = "presliding_friction";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "after a reversal friction builds up over a small angle, however fast";
  static constexpr std::string_view source =
      "Al-Bender et al. 2005, The generalized Maxwell-slip model";
  static constexpr std::array<Term, 4> terms{
      {{"wide", "Nm"}, {"half", "Nm"}, {"quarter", "Nm"}, {"eighth", "Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::output_position};
  static constexpr Traits traits{.one_signed = true, .dissipative = true, .loop = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::both_directions}}};
  static constexpr std::string_view reversal = "built up anew after each reversal";

  struct State {
    typename Elements::State elements;
    Phase<S> output;  ///< of the last sample, on the springs' grid
  };

  S presliding_width = S(0.01);  ///< w, rad at the output, > 0

  static constexpr auto shapes() noexcept {
    return std::array{Shape<PreslidingFriction, S>{
        "presliding_width", "rad", &PreslidingFriction::presliding_width, S(1e-5), S(1), true}};
  }

  constexpr Row<S, 4> row(const Sample<S>& at, State& state) const noexcept {
    const S width = presliding_width * (S(0.5) / math::pi<S>);  // turns
    const Phase<S> output = Elements::on_grid(at.output_position.phase, width);
    Elements::step(state.elements, (output - state.output).shortest(), width);
    state.output = output;
    return Elements::shares(state.elements, width);
  }

  constexpr bool settled(const State& state) const noexcept {
    return Elements::settled(state.elements);
  }
};

}  // namespace flexspline
