/// Temperature from a thermistor in a voltage divider.
///
///   R = V R_a / (V_cc − V),   1/T = 1/T_n + ln(R / R_n) / B      (kelvin)
///
/// R_a lies between supply and converter, the thermistor between converter and ground: warmer is
/// less voltage. Computed as T_n − T_n² L / (T_n L + B), L = ln(R / R_n), which costs no digits of
/// a float where T is near T_n. At R = R_n: T_n. A voltage of 0 or below is a short, one of V_cc or
/// above an open line: `out_of_range`, as is a resistance so small that the formula has no
/// temperature for it. The noise of the reading is the converter's over dV/dT, best where R = R_a.
/// Source: zhang_disturbance_elimination (6), (7).
#pragma once

#include "flexspline/fields.hpp"
#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename S>
struct Thermistor {
  S supply_voltage = S(3.3);        ///< V_cc, V, > 0
  S divider_resistance = S(10000);  ///< R_a, Ω, > 0
  S nominal_resistance = S(10000);  ///< R_n, Ω, > 0
  S beta = S(3435);                 ///< B, K, > 0
  S nominal_temperature = S(25);    ///< T_n, °C

  static constexpr auto fields() noexcept {
    return std::tuple{
        Field{"supply_voltage", "V", &Thermistor::supply_voltage, positive<S>},
        Field{"divider_resistance", "ohm", &Thermistor::divider_resistance, positive<S>},
        Field{"nominal_resistance", "ohm", &Thermistor::nominal_resistance, positive<S>},
        Field{"beta", "K", &Thermistor::beta, positive<S>},
        Field{"nominal_temperature", "deg C", &Thermistor::nominal_temperature, finite<S>}};
  }

  static constexpr S zero_celsius = S(273.15L);  ///< K

  /// `voltage` at the converter, V; `temperature` in °C.
  constexpr Status temperature(S voltage, S& temperature) const noexcept {
    if (!math::is_finite(voltage)) return Status::not_finite;
    const S rest = supply_voltage - voltage;
    if (!(voltage > S(0)) || !(rest > S(0))) return Status::out_of_range;
    const S nominal = nominal_temperature + zero_celsius;
    const S ratio = voltage * divider_resistance / (rest * nominal_resistance);
    const S cooler = nominal * math::log(ratio);
    const S inverse = cooler + beta;
    if (!(inverse > S(0))) return Status::out_of_range;
    const S found = nominal_temperature - nominal * (cooler / inverse);
    if (!math::is_finite(found)) return Status::not_finite;
    temperature = found;
    return Status::ok;
  }

  /// The inverse: what the converter reads at a temperature above absolute zero.
  constexpr Status voltage(S temperature, S& voltage) const noexcept {
    if (!math::is_finite(temperature)) return Status::not_finite;
    const S kelvin = temperature + zero_celsius;
    if (!(kelvin > S(0))) return Status::out_of_range;
    const S nominal = nominal_temperature + zero_celsius;
    const S warmer = (temperature - nominal_temperature) / (kelvin * nominal);
    const S resistance = nominal_resistance * math::exp(-beta * warmer);
    const S found = supply_voltage * (resistance / (divider_resistance + resistance));
    if (!math::is_finite(found)) return Status::not_finite;
    voltage = found;
    return Status::ok;
  }
};

}  // namespace flexspline
