/// The chain over a log, sample by sample, as on the device.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "flexspline/estimators/chain.hpp"
#include "flexspline/estimators/preprocessing.hpp"
#include "host/replay_estimators.hpp"

namespace flexspline::batch {

using LogChain = Chain<double>;

/// A channel or a result of the chain by its name.
template <typename Row>
struct NamedField {
  std::string_view name;
  double Row::* field;
};

inline constexpr std::array<NamedField<LogChain::Input>, 12> chain_inputs{{
    {"voltage", &LogChain::Input::voltage},
    {"thermistor_voltage", &LogChain::Input::thermistor_voltage},
    {"temperature", &LogChain::Input::temperature},
    {"sensor_torque", &LogChain::Input::sensor_torque},
    {"sensor_intrinsic", &LogChain::Input::sensor_intrinsic},
    {"motor_torque", &LogChain::Input::motor_torque},
    {"momentum", &LogChain::Input::momentum},
    {"observer_intrinsic", &LogChain::Input::observer_intrinsic},
    {"torsion", &LogChain::Input::torsion},
    {"gear_known", &LogChain::Input::gear_known},
    {"link_momentum", &LogChain::Input::link_momentum},
    {"velocity", &LogChain::Input::velocity},
}};

inline constexpr std::array<NamedField<LogChain::Output>, 8> chain_outputs{{
    {"temperature", &LogChain::Output::temperature},
    {"sensor_torque", &LogChain::Output::sensor_torque},
    {"external_sensor", &LogChain::Output::external_sensor},
    {"external_observer", &LogChain::Output::external_observer},
    {"external_compliance", &LogChain::Output::external_compliance},
    {"external_compliant_observer", &LogChain::Output::external_compliant_observer},
    {"external_merged", &LogChain::Output::external_merged},
    {"merge_weight", &LogChain::Output::merge_weight},
}};

/// A borrowed column of an input or a result.
template <typename Row, typename Value>
struct ChainColumn {
  double Row::* field;
  Value* values;
};

/// The columns of one run; flags, faults, missed stages and contact of each row beside the results.
struct ChainRun {
  std::size_t size = 0;
  const double* time = nullptr;
  std::span<const ChainColumn<LogChain::Input, const double>> inputs;
  std::span<const ChainColumn<LogChain::Output, double>> outputs;
  std::uint8_t* flags = nullptr;
  std::uint8_t* faults = nullptr;
  std::uint16_t* missed = nullptr;
  bool* contact = nullptr;
};

/// The stages that a chain has.
inline Stage configured(const LogChain::Config& config) noexcept {
  const auto bit = [](bool has, Stage stage) { return has ? stage : Stage::none; };
  return bit(config.thermistor.has_value(), Stage::thermistor) |
         bit(config.compensation.has_value(), Stage::compensation) |
         bit(config.sensor, Stage::sensor) | bit(config.observer.has_value(), Stage::observer) |
         bit(config.compliance.has_value(), Stage::compliance) |
         bit(config.compliant_observer.has_value(), Stage::compliant_observer) |
         bit(config.logistic.has_value() || config.kalman.has_value(), Stage::merge) |
         bit(config.collision.has_value(), Stage::collision);
}

/// A row whose time does not move on repeats the last good values, and all its stages missed;
/// values before the first good ones are NaN.
inline void replay_chain(const LogChain::Config& config, const ChainRun& run) noexcept {
  LogChain::State state;
  LogChain::Output held;
  for (const auto& output : chain_outputs) held.*output.field = unknown;
  const Stage all = configured(config);
  replay(run.time, run.size, [&](std::size_t i, double period) {
    LogChain::Input in;
    in.period = period;
    for (const auto& column : run.inputs) in.*column.field = column.values[i];
    const Status status = LogChain::step(config, state, in, held);
    const bool good = status == Status::ok;
    if (good) Preprocessing<double>::compare(config, held);
    for (const auto& column : run.outputs) column.values[i] = held.*column.field;
    run.flags[i] = static_cast<std::uint8_t>(good ? held.flags : Flag::none);
    run.faults[i] = static_cast<std::uint8_t>(good ? held.faults : Fault::none);
    run.missed[i] = static_cast<std::uint16_t>(good ? held.missed : all);
    run.contact[i] = held.contact;
    return status;
  });
}

}  // namespace flexspline::batch
