/// Torque from the voltage of the sensor's bridge.
///
///   τ = k V + zero + compensation(T)
///
/// The compensation comes from TemperatureCompensation, 0 without one. Outside [low, high] volts:
/// `extrapolated`.
/// Source: zhang_disturbance_elimination (10), (25): 62.738 Nm/V, 2.1835 Nm. A_0 of (10) is the
/// zero, A_1 T + A_2 T² counted from the reference temperature the compensation.
#pragma once

#include <limits>

#include "flexspline/fields.hpp"
#include "flexspline/math.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename S>
struct Calibration {
  S sensitivity = 0;                       ///< k, Nm/V
  S zero = 0;                              ///< Nm, the torque that zero volts stand for
  S low = -std::numeric_limits<S>::max();  ///< V, range of the calibration
  S high = std::numeric_limits<S>::max();

  static constexpr auto fields() noexcept {
    return std::tuple{Field{"sensitivity", "Nm/V", &Calibration::sensitivity, finite<S>},
                      Field{"zero", "Nm", &Calibration::zero, finite<S>},
                      Field{"low", "V", &Calibration::low, finite<S>, "voltage_range", false},
                      Field{"high", "V", &Calibration::high, finite<S>, "voltage_range", false}};
  }

  /// `voltage` V; `compensation` and result in Nm, positive outward.
  constexpr Status torque(S voltage, S compensation, FlaggedTorque<S>& out) const noexcept {
    const FlaggedTorque<S> found = reading(voltage, compensation);
    if (!math::is_finite(found.torque)) return Status::not_finite;
    out = found;
    return Status::ok;
  }

  /// The same, not finite where the voltage or the compensation is not.
  constexpr FlaggedTorque<S> reading(S voltage, S compensation) const noexcept {
    return {sensitivity * voltage + zero + compensation, extrapolated(voltage, low, high)};
  }
};

}  // namespace flexspline
