#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/maxwell_slip.hpp"

namespace flexspline {

/// A sensor that reads less while the torque rises than while it falls.
///
///   τ = −Σ_k  c_k z_k / w_k     on the path of the load τ_load, widths w_k in Nm
///
/// z_k: four springs that slip at w, w/2, w/4, w/8 (see MaxwellSlip): in the sensor's body, its
/// bolts, its glue. Linear in c, half the height of each one's loop, ≥ 0 where the reading lags
/// behind. The slope that all have after a reversal of the load is part of the loop; that of the
/// whole is gain_error.
/// Source: zhang_disturbance_elimination states 0.903 % after (25); the model is that of
/// [AlBender2005].
template <typename S>
struct TorqueHysteresis {
  using Elements = MaxwellSlip<S, 4>;

  static constexpr std::string_view name = "torque_hysteresis";
  static constexpr std::string_view targets = "S";
  static constexpr std::string_view signature =
      "the residual over the load is a loop: rising and falling torque differ";
  static constexpr std::string_view source =
      "Al-Bender et al. 2005, The generalized Maxwell-slip model";
  static constexpr std::array<Term, 4> terms{
      {{"wide", "Nm"}, {"half", "Nm"}, {"quarter", "Nm"}, {"eighth", "Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::load};
  static constexpr Traits traits{.loop = true};
  static constexpr std::array<Demand, 2> demands{
      {{Excitation::any_load}, {Excitation::there_and_back}}};
  static constexpr std::string_view reversal = "a loop between reversals of the load";

  struct State {
    typename Elements::State elements;
    S load = 0;  ///< Nm, of the last sample, on the springs' grid
  };

  S load_width = S(10);  ///< w, Nm, > 0

  static constexpr auto shapes() noexcept {
    return std::array{Shape<TorqueHysteresis, S>{"load_width", "Nm", &TorqueHysteresis::load_width,
                                                 S(0.01), S(1000), true}};
  }

  constexpr Row<S, 4> row(const Sample<S>& at, State& state) const noexcept {
    const S load = Elements::on_grid(at.load, load_width);
    Elements::step(state.elements, load - state.load, load_width);
    state.load = load;
    return Elements::shares(state.elements, -load_width);
  }

  constexpr bool settled(const State& state) const noexcept {
    return Elements::settled(state.elements);
  }
};

}  // namespace flexspline
