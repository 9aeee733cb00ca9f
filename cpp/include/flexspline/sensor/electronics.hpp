/// From the bridge's millivolts to a number: amplifier, RC low pass, converter; and their noise.
///
///   u = G U + offset,   y ← y + (1 − e^{−T/RC}) (u − y),   code = round(y / LSB)
///   LSB = 2 V_ref / 2^bits, codes −2^(bits−1) … 2^(bits−1) − 1
///
/// The low pass is exact for an input held over the period. A code at the end of its range is
/// flagged `saturated`, never passed off as a reading. Late by RC. The first sample starts the
/// low pass where the input is.
///
/// Noise as variances in V², each at the place where it arises:
///   thermal noise of a resistance R   4 k T R per Hz     [Johnson1928], [Nyquist1928]
///   noise bandwidth of an RC low pass  1 / (4 R C) Hz
///   rounding to LSB                    LSB² / 12
///   thermal noise of the RC itself     k T / C
/// Source: zhang_disturbance_elimination §2.2, Fig. 5 (gain 200, RC, AD7790 of 16 bits).
#pragma once

#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

namespace noise {

inline constexpr double boltzmann = 1.380649e-23;  ///< J/K
inline constexpr double zero_celsius = 273.15;     ///< K

/// V²/Hz of a resistance in Ω at a temperature in °C.
template <typename S>
constexpr S thermal_density(S resistance, S temperature) noexcept {
  return S(4 * boltzmann) * (temperature + S(zero_celsius)) * resistance;
}
/// Hz: white noise through an RC low pass has the power of this band.
template <typename S>
constexpr S bandwidth(S time_constant) noexcept {
  return S(0.25) / time_constant;
}
/// V² of rounding to steps of `step` V.
template <typename S>
constexpr S rounding(S step) noexcept {
  return step * step / S(12);
}
/// V² at a capacitance in F that a resistor charges, at a temperature in °C.
template <typename S>
constexpr S of_capacitance(S capacitance, S temperature) noexcept {
  return S(boltzmann) * (temperature + S(zero_celsius)) / capacitance;
}

}  // namespace noise

/// Variances at the converter, V².
template <typename S>
struct NoiseVariances {
  S bridge;     ///< thermal noise of its output resistance, amplified, in the low pass's band
  S amplifier;  ///< of its input noise, likewise
  S low_pass;   ///< k T / C
  S rounding;   ///< LSB² / 12
};

template <typename S>
struct Conditioning {
  struct Config {
    S gain = S(200);
    S offset = S(0);            ///< V at the converter: unbalanced bridge and amplifier
    S time_constant = S(1e-3);  ///< RC, s, > 0
    S reference = S(2.5);       ///< V; the converter reads −reference to +reference
    int bits = 16;              ///< 2 to 24
  };
  struct State {
    S filtered = 0;  ///< V
    bool started = false;
  };

  static constexpr S step_size(const Config& config) noexcept {
    return S(2) * config.reference / static_cast<S>(std::int32_t(1) << config.bits);
  }

  /// `voltage`: what the converter's code stands for, V. `flags`: saturated at its ends.
  static constexpr Status step(const Config& config, State& state, S bridge_voltage, S period,
                               S& voltage, Flag& flags) noexcept {
    if (!math::is_finite(bridge_voltage)) return Status::not_finite;
    if (state.started && (!math::is_finite(period) || !(period > S(0)))) return Status::bad_period;
    const S input = config.gain * bridge_voltage + config.offset;
    const S gain = state.started ? -math::expm1_negative(period / config.time_constant) : S(1);
    const S filtered = state.filtered + gain * (input - state.filtered);
    if (!math::is_finite(filtered)) return Status::not_finite;
    state = {filtered, true};
    const S step = step_size(config);
    const auto end = static_cast<S>(std::int32_t(1) << (config.bits - 1));
    const S held = math::clamp(filtered / step, -end, end - S(1));
    const auto code = static_cast<std::int32_t>(held + (held < S(0) ? S(-0.5) : S(0.5)));
    voltage = static_cast<S>(code) * step;
    const S top = end - S(1);
    flags = (held <= -end || held >= top) ? Flag::saturated : Flag::none;
    return Status::ok;
  }

  /// `resistance`: Ω at the bridge's output; `amplifier_noise`: V/√Hz at its input;
  /// `capacitance`: F of the low pass; `temperature`: °C.
  static constexpr NoiseVariances<S> noise_variances(const Config& config, S resistance,
                                                     S amplifier_noise, S capacitance,
                                                     S temperature) noexcept {
    const S amplified = config.gain * config.gain * noise::bandwidth(config.time_constant);
    return {noise::thermal_density(resistance, temperature) * amplified,
            amplifier_noise * amplifier_noise * amplified,
            noise::of_capacitance(capacitance, temperature), noise::rounding(step_size(config))};
  }
};

}  // namespace flexspline
