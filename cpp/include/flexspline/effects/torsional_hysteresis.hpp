#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/maxwell_slip.hpp"

namespace flexspline {

/// Torsion that depends on the way that it was reached: what is driven lags behind.
///
///   Δθ = Σ_k  c_k z_k / w_k     on the path of the load τ, widths w_k in Nm at the output
///   Δθ = −Σ_k c_k z_k / w_k     on the path of the motor's angle θ, widths in rad at the motor
///
/// z_k: four springs that slip at w, w/2, w/4, w/8 (see MaxwellSlip). Linear in c, half the height
/// of each one's loop, ≥ 0 where the loop costs energy: a rising load has not yet turned the motor
/// ahead as far as it will; a motor that turns forward runs ahead of an output that rubs. Steps of
/// θ are taken the short way, so it must turn less than half a turn between samples. Source:
/// full_range_torque_estimation §I (refs. 11 to 13, [Tjahjowidodo2013]); the step beyond its (14).
template <typename S>
struct TorsionalHysteresis {
  using Elements = MaxwellSlip<S, 4>;

  static constexpr std::string_view name = "torsional_hysteresis";
  static constexpr std::string_view targets = "D";
  static constexpr std::string_view signature =
      "the torsion depends on the way that load or motor came";
  static constexpr std::string_view source =
      "Tjahjowidodo et al. 2013, nonlinear torsional behaviour in harmonic drives";
  static constexpr std::array<Term, 4> terms{
      {{"wide", "rad"}, {"half", "rad"}, {"quarter", "rad"}, {"eighth", "rad"}}};
  static constexpr std::array<Channel, 2> reads{Channel::load, Channel::motor_position};
  static constexpr Traits traits{.one_signed = true, .dissipative = true, .loop = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::there_and_back}}};
  static constexpr std::string_view reversal = "a loop between reversals";
  static constexpr std::array<Path, 2> paths{
      {{Channel::load, "load_width"}, {Channel::motor_position, "angle_width"}}};

  struct State {
    typename Elements::State elements;
    S load = 0;      ///< Nm, of the last sample, on the springs' grid
    Phase<S> motor;  ///< of the last sample, likewise
  };

  S load_width = S(10);    ///< w, Nm at the output, > 0
  S angle_width = S(0.5);  ///< w, rad at the motor, > 0
  S path = S(0);           ///< 0: of the load; 1: of the motor's angle

  static constexpr auto shapes() noexcept {
    return std::array{
        Shape<TorsionalHysteresis, S>{"load_width", "Nm", &TorsionalHysteresis::load_width, S(0.01),
                                      S(1000), true},
        Shape<TorsionalHysteresis, S>{"angle_width", "rad", &TorsionalHysteresis::angle_width,
                                      S(1e-3), S(100), true},
        Shape<TorsionalHysteresis, S>{"path", "1", &TorsionalHysteresis::path, S(0), S(1), false}};
  }

  constexpr Row<S, 4> row(const Sample<S>& at, State& state) const noexcept {
    if (path < S(0.5)) {
      const S load = Elements::on_grid(at.load, load_width);
      Elements::step(state.elements, load - state.load, load_width);
      state.load = load;
      return Elements::shares(state.elements, load_width);
    }
    const S width = angle_width * (S(0.5) / math::pi<S>);  // turns
    const Phase<S> motor = Elements::on_grid(at.motor_position.phase, width);
    Elements::step(state.elements, (motor - state.motor).shortest(), width);
    state.motor = motor;
    return Elements::shares(state.elements, -width);
  }

  constexpr bool settled(const State& state) const noexcept {
    return Elements::settled(state.elements);
  }
};

}  // namespace flexspline
