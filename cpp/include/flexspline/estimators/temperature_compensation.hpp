/// Torque to add to a sensor's reading so that temperature leaves no trace in it.
///
///   τ = Σ_k c_k (T_b − T_0)^k + g (T − T_b),     k = 1 … Degree
///   T_b ← T_b + (1 − e^(−t / t_lag)) (T − T_b)
///
/// T is what the thermistor says, T_b the temperature of the elastic body, which follows it late by
/// a first-order lag; g stands for a bridge that is warmed unevenly, and fades when T_b has caught
/// up. The polynomial alone is the paper's, lag and gradient are the step beyond it. The lag is
/// exact for a temperature that holds its new value over the period t before the sample. The first
/// sample starts with T_b = T: no step, and no gradient. With t_lag = 0: T_b = T. Outside
/// [low, high]: `extrapolated`. A sample that is refused changes nothing; the next period is then
/// longer.
/// Source: zhang_disturbance_elimination (8)–(11), (24). b of (9) is this torque; that of (24) is a
/// voltage, A' of (11), so c = −sensitivity · A'. The text says that the reading rises with
/// temperature; by (24) it falls.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "flexspline/each_place.hpp"
#include "flexspline/fields.hpp"
#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename S>
struct BodyTemperature {
  S body = 0;  ///< T_b, °C
  bool started = false;
};

template <typename S, std::size_t Degree = 6>
struct TemperatureCompensation {
  using State = BodyTemperature<S>;
  struct Config {
    using Estimator = TemperatureCompensation;

    S reference_temperature = S(25);         ///< T_0, °C
    std::array<S, Degree> coefficients{};    ///< c_1 first, Nm/K^k; those not given are 0
    S gradient = 0;                          ///< g, Nm/K
    S thermal_lag = 0;                       ///< t_lag, s, ≥ 0
    S low = -std::numeric_limits<S>::max();  ///< °C, range of the fit
    S high = std::numeric_limits<S>::max();

    static constexpr auto fields() noexcept {
      return std::tuple{
          Field{"reference_temperature", "deg C", &Config::reference_temperature, finite<S>},
          Field{"coefficients", "Nm/K^k, k from 1", &Config::coefficients, finite<S>},
          Field{"gradient", "Nm/K", &Config::gradient, finite<S>},
          Field{"thermal_lag", "s", &Config::thermal_lag, not_negative<S>},
          Field{"low", "deg C", &Config::low, finite<S>, "temperature_range", false},
          Field{"high", "deg C", &Config::high, finite<S>, "temperature_range", false}};
    }
  };
  /// `temperature` T, °C; `period`: s since the last good sample.
  static constexpr Status step(const Config& config, State& state, S temperature, S period,
                               FlaggedTorque<S>& out) noexcept {
    if (!math::is_positive(period)) return Status::bad_period;
    return advance(config, state, temperature, period, out);
  }

  /// The same for a period that is known to be good.
  static constexpr Status advance(const Config& config, State& state, S temperature, S period,
                                  FlaggedTorque<S>& out) noexcept {
    S body = temperature;
    S torque = drift(config, body);
    const bool lags = config.thermal_lag > S(0);
    if (lags) {
      const S last = state.started ? state.body : temperature;
      body = last - math::expm1_negative(period / config.thermal_lag) * (temperature - last);
      torque = drift(config, body) + config.gradient * (temperature - body);
    }
    if (!math::is_finite(torque)) return Status::not_finite;  // as is NaN · 0 and ∞ · 0
    if (lags) state = {body, true};
    out = {torque, extrapolated(temperature, config.low, config.high)};
    return Status::ok;
  }

 private:
  static constexpr S drift(const Config& config, S body) noexcept {
    const S warmer = body - config.reference_temperature;
    S sum = S(0);
    for_each_place<Degree>(
        [&](std::size_t k) { sum = (sum + config.coefficients[Degree - 1 - k]) * warmer; });
    return sum;
  }
};

}  // namespace flexspline
