/// Strain gauges on the spokes of a torque sensor, and the Wheatstone bridge they form.
///
/// Torque bends a spoke: the gauge on one flank is stretched (sign +1), the one on the other
/// flank compressed (sign −1). The oval flexspline bends the spoke too, which no gauge can tell
/// from torque, and stretches it, which both flanks feel alike. With β the angle of the wave
/// generator against the flexspline and φ_i where gauge i sits, x = β − φ_i:
///
///   ε_i = s_i (ε_t + Σ_o b_o cos(o x) + b'_o sin(o x)) + Σ_o t_o cos(o x) + t'_o sin(o x)
///         + α_i ΔT_i + γ_i ΔT_i²
///   U   = U_s K / n · Σ_i a_i k_i ε_i
///
/// a_i = ±1 is the arm of the bridge, k_i the gauge's sensitivity against the nominal gauge
/// factor K. With n = 4, a = s, k = 1 this is (5): U = K ε_t U_s. Eight gauges are two in series
/// an arm, so each counts half.
///
/// (1) of the paper has one ε_w in both gauges of a pair: that is the stretching t here, and
/// leaves nothing of the sinusoid in (2). Hashimoto's pair, and (2) as it is meant, differ by
/// 2 b: the bending.
/// Source: zhang_disturbance_elimination (1)–(5), Fig. 8; [Hashimoto1993] (its ref. 12).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexspline/angle.hpp"

namespace flexspline {

/// A gauge as it is bonded and wired.
template <typename S>
struct Gauge {
  Phase<S> angle;              ///< φ, around the joint
  S sign = S(1);               ///< s: +1 stretched by a positive torque, −1 compressed
  S arm = S(1);                ///< a: +1 or −1, which arm of the bridge it is
  S sensitivity = S(1);        ///< k: of the real gauge, as bonded, to the nominal one
  S thermal_linear = S(0);     ///< α, apparent strain 1/K
  S thermal_quadratic = S(0);  ///< γ, 1/K²
};

/// Strain that the wave generator makes, `order` periods per turn against the flexspline.
template <typename S>
struct WaveStrain {
  std::uint32_t order = 2;
  math::Phasor<S> bending{S(0), S(0)};     ///< b, b': of opposite sign on both flanks of a spoke
  math::Phasor<S> stretching{S(0), S(0)};  ///< t, t': of one sign on both
};

/// How much of the strain along a spoke a gauge reads that is turned by `tilt` out of it:
/// cos² − ν sin², ν Poisson's ratio of the body. 1 without tilt, −ν across.
template <typename S>
constexpr S tilted(Phase<S> tilt, S poisson) noexcept {
  const math::Phasor<S> p = tilt.phasor();
  return p.cosine * p.cosine - poisson * p.sine * p.sine;
}

/// k of a gauge whose factor is off by `factor_error` of itself and that is bonded askew.
template <typename S>
constexpr S sensitivity_of(S factor_error, Phase<S> tilt, S poisson) noexcept {
  return (S(1) + factor_error) * tilted(tilt, poisson);
}

/// a cos(angle) + b sin(angle) for the phasor (a, b).
template <typename S>
constexpr S along(const math::Phasor<S>& amplitude, const math::Phasor<S>& angle) noexcept {
  return amplitude.cosine * angle.cosine + amplitude.sine * angle.sine;
}

/// Apparent strain of a gauge that is `warmer` K above the reference temperature.
template <typename S>
constexpr S thermal_strain(const Gauge<S>& gauge, S warmer) noexcept {
  return warmer * (gauge.thermal_linear + warmer * gauge.thermal_quadratic);
}

/// ε_i of one gauge at wave generator angle β, without its thermal part.
template <typename S>
constexpr S mechanical_strain(const Gauge<S>& gauge, S torque_strain, const WaveStrain<S>* waves,
                              std::size_t count, Phase<S> wave_generator) noexcept {
  S bent = torque_strain;
  S stretched = S(0);
  for (std::size_t k = 0; k < count; ++k) {
    const Phase<S> x = math::Bits<S>(waves[k].order) * (wave_generator - gauge.angle);
    const math::Phasor<S> p = x.phasor();
    bent += along(waves[k].bending, p);
    stretched += along(waves[k].stretching, p);
  }
  return gauge.sign * bent + stretched;
}

/// The gauges of one bridge, `count` ≤ N of them in use.
template <typename S, std::size_t N>
struct Bridge {
  std::array<Gauge<S>, N> gauges{};
  std::size_t count = N;
  S gauge_factor = S(2);  ///< K
  S supply = S(3.3);      ///< U_s, V

  /// Output in V from the strain of each gauge: (5).
  constexpr S voltage(const S* strain) const noexcept {
    S sum = S(0);
    for (std::size_t i = 0; i < count; ++i) {
      sum += gauges[i].arm * gauges[i].sensitivity * strain[i];
    }
    return supply * gauge_factor / static_cast<S>(count) * sum;
  }

  /// Share of the torque strain that reaches the output: 1 for a full bridge, 0 where the
  /// gauges cancel the torque itself.
  constexpr S torque_gain() const noexcept {
    S sum = S(0);
    for (std::size_t i = 0; i < count; ++i) {
      sum += gauges[i].arm * gauges[i].sign * gauges[i].sensitivity;
    }
    return sum / static_cast<S>(count);
  }

  /// What is left of a wave at the output, as strain: C cos(o β) + S sin(o β). A gauge at φ sees
  /// the wave turned back by o φ.
  constexpr math::Phasor<S> ripple(const WaveStrain<S>& wave) const noexcept {
    math::Phasor<S> sum{S(0), S(0)};
    for (std::size_t i = 0; i < count; ++i) {
      const math::Phasor<S> turned = (math::Bits<S>(wave.order) * gauges[i].angle).phasor();
      const S weight = gauges[i].arm * gauges[i].sensitivity;
      const S cosine = gauges[i].sign * wave.bending.cosine + wave.stretching.cosine;
      const S sine = gauges[i].sign * wave.bending.sine + wave.stretching.sine;
      sum.cosine += weight * (cosine * turned.cosine - sine * turned.sine);
      sum.sine += weight * (cosine * turned.sine + sine * turned.cosine);
    }
    return {sum.cosine / static_cast<S>(count), sum.sine / static_cast<S>(count)};
  }
};

}  // namespace flexspline
