#include <algorithm>
#include <string>

#include "host/replay_chain.hpp"
#include "host/replay_preprocessing.hpp"
#include "stages.hpp"

namespace flexspline::bindings {
namespace {

using Config = StagesConfig;

/// Forward Euler that cannot be stable at the log's mean period.
void require_stable(const std::optional<MomentumObserver<double>::Config>& observer,
                    const double* time, std::size_t size) {
  if (!observer || observer->discretisation == Discretisation::exact || size < 2) return;
  const double period = (time[size - 1] - time[0]) / static_cast<double>(size - 1);
  if (!(observer->gain * period >= 2)) return;
  refuse("the observer's gain of " + std::to_string(observer->gain) +
         " 1/s is not stable by Euler at a period of " + std::to_string(period) +
         " s; gain times period must stay below 2, or take 'exact'");
}

/// The results that a chain with these stages has.
bool gives(const Config& config, std::string_view name) {
  const bool merges = config.logistic.has_value() || config.kalman.has_value();
  if (name == "temperature") {
    return config.thermistor.has_value() || config.compensation.has_value();
  }
  if (name == "sensor_torque" || name == "external_sensor") return config.sensor;
  if (name == "external_observer") return config.observer.has_value();
  if (name == "external_compliance") return config.compliance.has_value();
  if (name == "external_compliant_observer") return config.compliant_observer.has_value();
  return name == "external_merged" ? merges : config.logistic.has_value();
}

/// Columns by name, held together with what a run needs of them.
struct Columns {
  std::vector<Array> arrays;
  std::vector<batch::ChainColumn<batch::LogChain::Input, const double>> inputs;
  const double* time = nullptr;
};

Columns columns_from(const py::dict& columns, std::size_t size) {
  Columns made;
  for (const auto& [key, value] : columns) {
    const auto name = key.cast<std::string>();
    made.arrays.push_back(value.cast<Array>());
    const double* values = column_or_null(made.arrays.back(), size, name.c_str());
    if (name == "time") {
      made.time = values;
      continue;
    }
    const auto* known =
        std::find_if(batch::chain_inputs.begin(), batch::chain_inputs.end(),
                     [&name](const auto& candidate) { return candidate.name == name; });
    if (known == batch::chain_inputs.end()) refuse("it reads no channel '" + name + "'");
    made.inputs.push_back({known->field, values});
  }
  if (made.time == nullptr) refuse("it needs the channel 'time'");
  return made;
}

py::dict run(const Config& config, const py::dict& columns, py::ssize_t size) {
  const auto count = static_cast<std::size_t>(size);
  const Columns in = columns_from(columns, count);
  require_stable(config.observer, in.time, count);
  require_stable(config.compliant_observer, in.time, count);
  py::dict results;
  std::vector<batch::ChainColumn<batch::LogChain::Output, double>> outputs;
  for (const auto& output : batch::chain_outputs) {
    if (!gives(config, output.name)) continue;
    py::array_t<double> values(size);
    outputs.push_back({output.field, values.mutable_data()});
    results[py::str(std::string(output.name))] = values;
  }
  py::array_t<std::uint8_t> flags(size);
  py::array_t<std::uint8_t> faults(size);
  py::array_t<std::uint16_t> missed(size);
  py::array_t<bool> contact(size);
  const batch::ChainRun rows{count,
                             in.time,
                             in.inputs,
                             outputs,
                             flags.mutable_data(),
                             faults.mutable_data(),
                             missed.mutable_data(),
                             contact.mutable_data()};
  {
    const py::gil_scoped_release release;
    batch::replay_chain(config, rows);
  }
  results["flags"] = flags;
  results["missed"] = missed;
  if (config.checks) results["faults"] = faults;
  if (config.collision) results["contact"] = contact;
  return results;
}

/// A column that the run writes into: a copy of what there is, NaN where there is nothing.
py::array_t<double> writable(const py::dict& columns, const char* name, py::ssize_t size) {
  py::array_t<double> made(size);
  double* values = made.mutable_data();
  if (!columns.contains(name)) {
    std::fill(values, values + size, batch::unknown);
    return made;
  }
  const auto given = columns[name].cast<Array>();
  const double* known = column_or_null(given, static_cast<std::size_t>(size), name);
  std::copy(known, known + size, values);
  return made;
}

py::dict prepare(const Config& config, const py::dict& columns, py::ssize_t size) {
  py::dict results;
  const auto column = [&](const std::string& name) {
    py::array_t<double> made = writable(columns, name.c_str(), size);
    results[py::str(name)] = made;
    return made.mutable_data();
  };
  py::array_t<std::uint8_t> faults(size);
  py::array_t<std::uint16_t> missed(size);
  const auto time = writable(columns, "time", size);
  batch::PreprocessedRun rows{static_cast<std::size_t>(size), time.data()};
  rows.output_position = column("output_position");
  rows.motor_position = column("motor_position");
  for (std::size_t k = 0; k < rows.numbers.size(); ++k) {
    rows.numbers[k] = column(std::string(batch::reading_numbers[k].name));
  }
  rows.faults = faults.mutable_data();
  rows.missed = missed.mutable_data();
  std::fill(rows.faults, rows.faults + size, std::uint8_t(0));
  std::fill(rows.missed, rows.missed + size, std::uint16_t(0));
  {
    const py::gil_scoped_release release;
    batch::replay_preprocessing(config, rows);
  }
  results["faults"] = faults;
  results["missed"] = missed;
  return results;
}

}  // namespace

void bind_chain(py::module_& module) {
  py::class_<Config>(module, "Chain",
                     "From raw channels to the external torque and a contact, as on the device.")
      .def(py::init(&stages_from), py::arg("config"))
      .def("run", &run, py::arg("columns"), py::arg("size"),
           R"(Results of each row by name, for the stages that the chain has.

A stage that misses a row keeps its last good values, NaN before the first, and sets its bit
in 'missed': 1 thermistor, 2 temperature_compensation, 4 sensor, 8 observer, 16 compliance,
32 merge, 64 collision, 128 compliant_observer. 'flags': 1 extrapolated, 2 saturated.
'faults', of reading_checks: 32 where sensor and observer disagree. Each run starts anew.)")
      .def("prepare", &prepare, py::arg("columns"), py::arg("size"),
           R"(Readings by name as the chain takes them: checked, derivatives made; NaN is missing.

'faults' of each row: 1 sensor, 2 motor, 4 speed, 8 motion, 16 encoders, 64 temperature.
'missed': 256 differentiator. Each run starts anew.)");
}

}  // namespace flexspline::bindings
