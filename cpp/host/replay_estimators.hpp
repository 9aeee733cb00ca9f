/// Estimators over arrays, sample by sample, as on the device.
///
/// A row that a step refuses, or whose time does not move on, repeats the last good values; before
/// the first good row they are NaN. The next good row's period counts from the last good one.
#pragma once

#include <cstddef>
#include <limits>

#include "flexspline/estimators/collision_detector.hpp"
#include "flexspline/estimators/compliance.hpp"
#include "flexspline/estimators/kalman_merge.hpp"
#include "flexspline/estimators/load_hysteresis.hpp"
#include "flexspline/estimators/momentum_observer.hpp"
#include "flexspline/estimators/temperature_compensation.hpp"
#include "flexspline/estimators/thermistor.hpp"

namespace flexspline::batch {

inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// Calls step(row, period) for each row; stops where it says `out_of_range`. The row where it
/// stopped, or `size`.
template <typename Step>
std::size_t replay(const double* time, std::size_t size, Step step) {
  bool started = false;
  double last = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const double first = math::is_finite(time[i]) ? 1.0 : unknown;  // its length is not used
    const Status status = step(i, started ? time[i] - last : first);
    if (status == Status::out_of_range) return i;
    if (status != Status::ok) continue;
    last = time[i];
    started = true;
  }
  return size;
}

/// Steps an estimator over its input columns; `held` is what rows before the first good one have.
/// The row where it stopped, or `size`.
template <typename Estimator, typename Value, typename... Input>
std::size_t replay_estimator(const double* time, std::size_t size,
                             const typename Estimator::Config& config, Value held, Value* values,
                             const Input*... inputs) {
  typename Estimator::State state;
  return replay(time, size, [&](std::size_t i, double period) {
    const Status status = Estimator::step(config, state, inputs[i]..., period, held);
    values[i] = held;
    return status;
  });
}

/// Torque of the drift of each row, Nm.
inline void replay_temperature_compensation(const double* time, const double* temperature,
                                            std::size_t size,
                                            const TemperatureCompensation<double>::Config& config,
                                            double* torque) noexcept {
  TemperatureCompensation<double>::State state;
  FlaggedTorque<double> held{unknown, Flag::none};
  replay(time, size, [&](std::size_t i, double period) {
    const Status status =
        TemperatureCompensation<double>::step(config, state, temperature[i], period, held);
    torque[i] = held.torque;
    return status;
  });
}

/// External torque of each row, Nm. The row where the gain and the period do not fit, or `size`.
inline std::size_t replay_observer(const double* time, const double* momentum,
                                   const double* known_torque, std::size_t size,
                                   const MomentumObserver<double>::Config& config,
                                   double* external) noexcept {
  return replay_estimator<MomentumObserver<double>>(time, size, config, unknown, external, momentum,
                                                    known_torque);
}

/// Merged torque of each row, Nm.
inline void replay_kalman_merge(const double* time, const double* velocity, const double* observer,
                                const double* compliance, std::size_t size,
                                const KalmanMerge<double>::Config& config,
                                double* merged) noexcept {
  replay_estimator<KalmanMerge<double>>(time, size, config, unknown, merged, velocity, observer,
                                        compliance);
}

/// Contact of each row; false before the first good row.
inline void replay_collision_detector(const double* time, const double* residual,
                                      const double* velocity, std::size_t size,
                                      const CollisionDetector<double>::Config& config,
                                      bool* contact) noexcept {
  replay_estimator<CollisionDetector<double>>(time, size, config, false, contact, residual,
                                              velocity);
}

}  // namespace flexspline::batch
