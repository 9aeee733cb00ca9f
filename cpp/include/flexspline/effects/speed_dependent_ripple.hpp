#pragma once

#include "flexspline/effects/harmonics.hpp"

namespace flexspline {

/// What a resonance adds to ripple of the motor side: amplitude and phase change with speed.
///
///   τ = Σ_k  Re (H(ρ_k) − 1) (a_k − i b_k) e^(i k β),     ρ_k = k v / v_r
///   H(ρ) = 1 / (1 − ρ² + 2 i ζ ρ)
///
/// β: θ, θ − q or θ + q (see Gear). Order k meets the resonance where the output turns at v_r / k;
/// its frequency is Ñ v_r / 2π, for all orders the same. At v = 0: 0, so that the ripple of
/// wave_generator_ripple or cogging at the same orders stands beside it. Near there the row grows
/// with v across the ripple (its phase turns) and with v² along it. Far above: −1 times the ripple,
/// which is then gone. As if the speed had been held: it must change little while the resonance
/// rings. Linear in a and b.
/// Source: [TuttleSeering1996], A nonlinear model of a harmonic drive gear transmission.
template <typename S, std::size_t K>
struct SpeedDependentRipple : Harmonics<S, K> {
  static constexpr std::string_view name = "speed_dependent_ripple";
  static constexpr std::string_view targets = "SM";
  static constexpr std::string_view signature =
      "ripple per motor turn that swells, shrinks or shifts with speed";
  static constexpr std::string_view source =
      "Tuttle and Seering 1996, A nonlinear model of a harmonic drive gear transmission";
  static constexpr std::array<Channel, 2> reads{Channel::motor_position, Channel::output_velocity};
  static constexpr Traits traits{};
  static constexpr std::array<Demand, 2> demands{
      {{Excitation::speed_ratio, 1.5}, {Excitation::resolved_order, 2}}};
  static constexpr std::array<Pair, 3> pairs{Pair::wave_generator_on_flexspline,
                                             Pair::wave_generator_on_circular_spline,
                                             Pair::motor_on_stator};

  S resonance_velocity = S(1);  ///< v_r, rad/s at the output, > 0
  S damping_ratio = S(0.2);     ///< ζ, > 0

  static constexpr auto shapes() noexcept {
    return std::array{
        Shape<SpeedDependentRipple, S>{"resonance_velocity", "rad/s",
                                       &SpeedDependentRipple::resonance_velocity, S(0.01), S(100),
                                       true},
        Shape<SpeedDependentRipple, S>{"damping_ratio", "1", &SpeedDependentRipple::damping_ratio,
                                       S(0.02), S(5), true}};
  }

  /// Cosine and sine of one order as the resonance adds to them.
  constexpr math::Phasor<S> modulated(const math::Phasor<S>& p, std::uint32_t order,
                                      S velocity) const noexcept {
    const S ratio = static_cast<S>(order) * velocity / resonance_velocity;
    const S rho = math::clamp(ratio, S(-1000), S(1000));
    const S square = rho * rho;
    const S turned = S(2) * damping_ratio * rho;
    const S left = S(1) - square;
    const S size = left * left + turned * turned;
    const S along = (square * left - turned * turned) / size;
    const S across = -turned / size;
    return {along * p.cosine - across * p.sine, along * p.sine + across * p.cosine};
  }

  constexpr Row<S, 2 * K> row(const Sample<S>& at) const noexcept {
    Row<S, 2 * K> result = Harmonics<S, K>::row(at);
    for_each_place<K>([&](std::size_t k) {
      if (k >= this->harmonics().size()) return;
      const math::Phasor<S> plain{result[2 * k], result[2 * k + 1]};
      const auto p = modulated(plain, this->harmonics()[k].order, at.output_velocity);
      result[2 * k] = p.cosine;
      result[2 * k + 1] = p.sine;
    });
    return result;
  }
};

}  // namespace flexspline
