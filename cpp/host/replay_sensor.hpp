/// A torque sensor over a log: strains and voltage of its bridge, and what the converter reads.
#pragma once

#include <limits>

#include "flexspline/sensor/bridge.hpp"
#include "flexspline/sensor/electronics.hpp"

namespace flexspline::batch {

inline constexpr std::size_t most_gauges = 16;
using AnyBridge = Bridge<double, most_gauges>;

/// `warmer`, K above the reference temperature, and `strain` have one column per gauge.
inline void replay_bridge(const AnyBridge& bridge, const WaveStrain<double>* waves,
                          std::size_t wave_count, const double* angle, const double* torque_strain,
                          const double* warmer, std::size_t size, double* strain,
                          double* voltage) noexcept {
  for (std::size_t row = 0; row < size; ++row) {
    const auto at = Angle<double>::from_radians(angle[row]).phase;
    for (std::size_t i = 0; i < bridge.count; ++i) {
      const auto& gauge = bridge.gauges[i];
      strain[i] = mechanical_strain(gauge, torque_strain[row], waves, wave_count, at) +
                  thermal_strain(gauge, warmer[i]);
    }
    voltage[row] = bridge.voltage(strain);
    strain += bridge.count;
    warmer += bridge.count;
  }
}

/// A row that the chain refuses repeats the last reading; NaN before the first.
inline void replay_conditioning(const double* time, const double* voltage, std::size_t size,
                                const Conditioning<double>::Config& config, double* read,
                                std::uint8_t* flags) noexcept {
  Conditioning<double>::State state;
  double held = std::numeric_limits<double>::quiet_NaN();
  Flag flag = Flag::none;
  double last = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    const Status done =
        Conditioning<double>::step(config, state, voltage[i], time[i] - last, held, flag);
    if (done == Status::ok) last = time[i];
    read[i] = held;
    flags[i] = static_cast<std::uint8_t>(flag);
  }
}

}  // namespace flexspline::batch
