/// Reading checks and differentiator over a log, sample by sample, as on the device.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "flexspline/estimators/chain.hpp"
#include "flexspline/estimators/preprocessing.hpp"
#include "host/replay_estimators.hpp"

namespace flexspline::batch {

/// A channel that is a number, by its name.
struct NamedReading {
  std::string_view name;
  double Reading<double>::* field;
};

inline constexpr std::array<NamedReading, 7> reading_numbers{{
    {"output_velocity", &Reading<double>::output_velocity},
    {"output_acceleration", &Reading<double>::output_acceleration},
    {"motor_torque", &Reading<double>::motor_torque},
    {"sensor_voltage", &Reading<double>::sensor_voltage},
    {"sensor_torque", &Reading<double>::sensor_torque},
    {"thermistor_voltage", &Reading<double>::thermistor_voltage},
    {"temperature", &Reading<double>::temperature},
}};

/// The columns of one run. Angles, rad, are NaN where there is none; a number that was taken out
/// or that the differentiator makes is written in its place.
struct PreprocessedRun {
  std::size_t size = 0;
  const double* time = nullptr;
  double* output_position = nullptr;
  double* motor_position = nullptr;
  std::array<double*, reading_numbers.size()> numbers{};
  std::uint8_t* faults = nullptr;
  std::uint16_t* missed = nullptr;
};

inline std::optional<Angle<double>> angle_of(double radians) noexcept {
  Angle<double> angle;
  if (read_radians(radians, angle) != Status::ok) return std::nullopt;
  return angle;
}

/// Works in place. A row whose time does not move on stays as it is.
inline void replay_preprocessing(const AnyStages<double>& stages,
                                 const PreprocessedRun& run) noexcept {
  Preprocessing<double>::State state;
  replay(run.time, run.size, [&](std::size_t i, double period) {
    if (!Chain<double>::is_period(period)) return Status::bad_period;
    Reading<double> in;
    Chain<double>::Output out;
    in.period = period;
    in.output_position = angle_of(run.output_position[i]);
    in.motor_position = angle_of(run.motor_position[i]);
    for (std::size_t k = 0; k < run.numbers.size(); ++k) {
      in.*reading_numbers[k].field = run.numbers[k][i];
    }
    Preprocessing<double>::step(stages, state, in, out);
    if (!in.output_position) run.output_position[i] = unknown;
    if (!in.motor_position) run.motor_position[i] = unknown;
    for (std::size_t k = 0; k < run.numbers.size(); ++k) {
      run.numbers[k][i] = in.*reading_numbers[k].field;
    }
    run.faults[i] = static_cast<std::uint8_t>(out.faults);
    run.missed[i] = static_cast<std::uint16_t>(out.missed);
    return Status::ok;
  });
}

}  // namespace flexspline::batch
