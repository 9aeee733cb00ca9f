/// A joint over a log, row by row, by the code of the device (flexspline/joint.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "flexspline/joint.hpp"
#include "host/any_model.hpp"
#include "host/replay_estimators.hpp"

namespace flexspline::batch {

/// A joint whose models and stages are chosen at run time.
using LogJoint = Joint<double, AnyModel, AnyModel, AnyModel, AnyModel>;

/// A number of a row by its name.
template <typename Row>
struct NamedField {
  std::string_view name;
  double Row::* field;
};

/// The numbers of a reading: those that models read, then the instruments'. Time and period are
/// made of the log's clock.
inline constexpr auto reading_numbers = [] {
  std::array<NamedField<Reading<double>>, numbers<double>.size() + instruments<double>.size()> all;
  auto next = all.begin();
  for (const Number<double>& each : numbers<double>) *next++ = {each.name(), each.read};
  for (const Instrument<double>& each : instruments<double>) *next++ = {each.name, each.read};
  return all;
}();

/// The place of a number of a reading; behind the last where there is none of the name.
constexpr std::size_t place_of_reading(std::string_view name) noexcept {
  std::size_t place = 0;
  while (place < reading_numbers.size() && reading_numbers[place].name != name) ++place;
  return place;
}

/// Whether a number of a reading is made of the log's clock.
constexpr bool of_the_clock(std::string_view name) noexcept {
  return name == "time" || name == "period";
}

/// What a stage makes of a row, NaN in rows that it missed.
struct NamedOutput {
  std::string_view name;
  double LogJoint::Chain::Output::* field;
  Stage by;
};

inline constexpr std::array<NamedOutput, 5> joint_outputs{{
    {"external_sensor", &LogJoint::Chain::Output::external_sensor, Stage::sensor},
    {"external_observer", &LogJoint::Chain::Output::external_observer, Stage::observer},
    {"external_compliance", &LogJoint::Chain::Output::external_compliance, Stage::compliance},
    {"external_compliant_observer", &LogJoint::Chain::Output::external_compliant_observer,
     Stage::compliant_observer},
    {"external_merged", &LogJoint::Chain::Output::external_merged, Stage::merge},
}};

/// What the stages read beside the channels.
inline constexpr std::array<NamedField<LogJoint::Chain::Input>, 7> joint_inputs{{
    {"velocity", &LogJoint::Chain::Input::velocity},
    {"momentum", &LogJoint::Chain::Input::momentum},
    {"motor_torque", &LogJoint::Chain::Input::motor_torque},
    {"observer_intrinsic", &LogJoint::Chain::Input::observer_intrinsic},
    {"torsion", &LogJoint::Chain::Input::torsion},
    {"gear_known", &LogJoint::Chain::Input::gear_known},
    {"link_momentum", &LogJoint::Chain::Input::link_momentum},
}};

/// The stages that a joint has.
inline Stage configured(const AnyStages<double>& stages) noexcept {
  Stage all = Stage::none;
  for_each_stage(
      stages,
      [&all](const StageInfo& info, const auto& stage) {
        if (bool(stage)) all = all | info.bit;
      },
      [](const auto&, auto, bool) {});
  return all;
}

/// The columns of a log that a joint reads, null where the log lacks one. The joint starts anew at
/// the rows `starts`, which rise from 0.
struct JointLog {
  std::size_t size = 0;
  std::span<const std::size_t> starts;
  const double* time = nullptr;             ///< s
  const double* output_position = nullptr;  ///< rad
  const double* motor_position = nullptr;   ///< rad
  std::array<const double*, reading_numbers.size()> numbers{};
};

/// The columns that a run fills, null where they are not asked for. Values are NaN in rows that
/// their stage missed.
struct JointResults {
  double* temperature = nullptr;    ///< °C
  double* sensor_torque = nullptr;  ///< Nm, compensated
  std::array<double*, joint_outputs.size()> outputs{};
  std::array<double*, joint_inputs.size()> inputs{};
  double* adapted = nullptr;  ///< rows of `LogJoint::Adapting::most` coefficients, behind the row
  std::uint8_t* told = nullptr;  ///< directions of their last round
  std::uint8_t* contact = nullptr;
  std::uint8_t* flags = nullptr;
  std::uint8_t* faults = nullptr;
  std::uint16_t* missed = nullptr;
};

inline std::optional<Angle<double>> angle_of(const double* radians, std::size_t row) noexcept {
  if (radians == nullptr || !math::is_finite(radians[row])) return std::nullopt;
  return Angle<double>::from_radians(radians[row]);
}

/// A joint that has seen nothing.
inline LogJoint::State start_of(const LogJoint& joint) {
  LogJoint::State state;
  state.sensor = state.sensor_without_load = joint.sensor.start();
  state.observed = joint.observed.start();
  state.torsion = joint.torsion.start();
  state.carried = joint.carried.start();
  return state;
}

/// What is read in one row; `period` as the replay has it, `time` since the log's first row.
inline Reading<double> reading_of(const JointLog& log, std::size_t row, double period) noexcept {
  Reading<double> in;
  in.period = period;
  in.time = log.time[row] - log.time[0];
  in.output_position = angle_of(log.output_position, row);
  in.motor_position = angle_of(log.motor_position, row);
  for (std::size_t k = 0; k < log.numbers.size(); ++k) {
    if (log.numbers[k] != nullptr) in.*reading_numbers[k].field = log.numbers[k][row];
  }
  return in;
}

/// Writes what a row gave; `good`: whether the joint took it.
inline void write(const JointResults& to, std::size_t row, bool good, Stage all,
                  const LogJoint::Chain::Output& out, const LogJoint::Trace& trace) noexcept {
  const Stage missed = good ? out.missed : all;
  const auto put = [row](double* column, bool known, double value) {
    if (column != nullptr) column[row] = known && math::is_finite(value) ? value : unknown;
  };
  const bool warm = good && !has(missed, Stage::thermistor) && !has(missed, Stage::compensation);
  put(to.temperature, warm, trace.sensed.temperature);
  put(to.sensor_torque, good, trace.sensed.torque);
  for (std::size_t k = 0; k < joint_outputs.size(); ++k) {
    put(to.outputs[k], !has(missed, joint_outputs[k].by), out.*joint_outputs[k].field);
  }
  for (std::size_t k = 0; k < joint_inputs.size(); ++k) {
    put(to.inputs[k], good, trace.input.*joint_inputs[k].field);
  }
  if (to.contact != nullptr) to.contact[row] = out.contact && !has(missed, Stage::collision);
  to.flags[row] = static_cast<std::uint8_t>(good ? out.flags : Flag::none);
  to.faults[row] = static_cast<std::uint8_t>(good ? out.faults : Fault::none);
  to.missed[row] = static_cast<std::uint16_t>(missed);
}

/// Lets the models of a joint look ahead over what reaches them as it is read: angles and time, and
/// the other channels where no stage before the chain changes them.
class Ahead {
 public:
  Ahead(LogJoint& joint, const JointLog& log) : joint_(joint), log_(log) {
    const auto know = [this](Channel channel, bool it) { known_[std::size_t(channel)] = it; };
    const bool plain = !joint.sensing.checks && !joint.sensing.differentiator;
    for (const Channel c : {Channel::output_position, Channel::motor_position, Channel::time}) {
      know(c, true);
    }
    for (const Number<double>& each : numbers<double>) {
      const bool changes = each.channel == Channel::temperature || of_the_clock(each.name());
      if (!changes) know(each.channel, plain);
    }
  }

  /// Rows from `row` on, as many as a block has room for and at most up to `last`, at the first of
  /// them; then one after the other.
  void turn_to(std::size_t row, std::size_t first, std::size_t last) {
    const std::size_t place = (row - first) % SampleBlock::capacity;
    if (place == 0) read(row, std::min(SampleBlock::capacity, last - row));
    for (AnyModel* model : models()) {
      if (place == 0) model->look_ahead(channels_, known_);
      model->turn_to(place);
    }
  }

 private:
  std::array<AnyModel*, 4> models() {
    return {&joint_.sensor, &joint_.observed, &joint_.torsion, &joint_.carried};
  }

  /// What a `Reading` has of these rows: NaN for what is missing.
  void read(std::size_t row, std::size_t count) {
    channels_ = {.size = count};
    for (std::size_t k = 0; k < numbers_.size(); ++k) {
      const bool time = numbers<double>[k].channel == Channel::time;
      const double* from = time ? log_.time : log_.numbers[k];
      const double start = time ? log_.time[0] : 0.0;
      const double most = joint_.limits.of(numbers<double>[k].channel);
      for (std::size_t i = 0; i < count; ++i) {
        const double value = from == nullptr ? unknown : from[row + i] - start;
        numbers_[k][i] = math::absolute(value) <= most ? value : unknown;
      }
      channels_.number[k] = numbers_[k].data();
    }
    const auto at = [row](const double* angle) { return angle == nullptr ? angle : angle + row; };
    channels_.output_position = at(log_.output_position);
    channels_.motor_position = at(log_.motor_position);
  }

  LogJoint& joint_;
  const JointLog& log_;
  AnyModel::Known known_{};
  std::array<SampleBlock::Column<double>, numbers<double>.size()> numbers_;
  Channels channels_;
};

/// A row whose time does not move on is missed by all stages; the period of the next one counts from
/// the last good one. What an adaptation learned goes on over the starts.
inline void replay_joint(LogJoint joint, const JointLog& log, const JointResults& to) {
  const Stage all = configured(joint.sensing) | configured(joint.estimating);
  const LogJoint::State fresh = start_of(joint);
  Ahead ahead(joint, log);
  LogJoint::State state = fresh;
  LogJoint::Chain::Output out;
  LogJoint::Trace trace;
  for (std::size_t k = 0; k < log.starts.size(); ++k) {
    const std::size_t first = log.starts[k];
    const std::size_t last = k + 1 < log.starts.size() ? log.starts[k + 1] : log.size;
    LogJoint::restart(state, fresh);
    replay(log.time + first, last - first, [&](std::size_t i, double period) {
      const std::size_t row = first + i;
      ahead.turn_to(row, first, last);
      const Status status = joint.step(state, reading_of(log, row, period), out, trace);
      write(to, row, status == Status::ok, all, out, trace);
      if (to.adapted != nullptr) {
        const auto now = joint.adapted(state);
        std::copy(now.begin(), now.end(), to.adapted + row * now.size());
      }
      if (to.told != nullptr) to.told[row] = state.adaptation.told;
      return status;
    });
  }
}

}  // namespace flexspline::batch
