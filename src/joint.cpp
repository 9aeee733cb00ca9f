#include <algorithm>
#include <string>

#include "host/replay_joint.hpp"
#include "stages.hpp"

namespace flexspline::bindings {
namespace {

using batch::LogJoint;

/// A design and its coefficients.
using Models = std::map<std::string, std::pair<batch::Design, std::vector<double>>>;

batch::AnyModel model_of(const Models& models, const char* name) {
  const auto found = models.find(name);
  if (found == models.end()) return {};
  const auto& [design, coefficients] = found->second;
  require_size(coefficients, design.columns(), false);
  return {design, coefficients};
}

/// By name, of readings that have one of their own.
using Limits = std::map<std::string, double>;

ReadingLimits<double> limits_from(Limits given) {
  ReadingLimits<double> made;
  for_each_field<ReadingLimits<double>>([&](const auto& field) {
    const auto found = given.find(std::string(field.name));
    if (found == given.end()) return;
    made.*field.member = found->second;
    given.erase(found);
  });
  if (!given.empty()) refuse("no reading '" + given.begin()->first + "' has a limit");
  return made;
}

LogJoint joint_from(const py::dict& stages, const Models& models, double effective_ratio,
                    double inertia, double link_inertia, double low, double high,
                    const Limits& limits) {
  for (const auto& [name, model] : models) {
    static constexpr std::array known{"sensor", "observed", "torsion", "carried"};
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      refuse("there is no model '" + name + "'");
    }
  }
  const StagesConfig config = stages_from(stages);
  return {.sensing = config,
          .estimating = config,
          .sensor = model_of(models, "sensor"),
          .observed = model_of(models, "observed"),
          .torsion = model_of(models, "torsion"),
          .carried = model_of(models, "carried"),
          .effective_ratio = effective_ratio,
          .inertia = inertia,
          .link_inertia = link_inertia,
          .low = low,
          .high = high,
          .limits = limits_from(limits)};
}

/// Columns by name, held together with the arrays that they point into.
struct JointColumns {
  std::vector<Array> arrays;
  batch::JointLog log;
};

JointColumns borrow_readings(const py::dict& columns, std::span<const std::size_t> starts) {
  if (!columns.contains("time")) refuse("it needs the channel 'time'");
  JointColumns made;
  made.log.starts = starts;
  made.log.size = columns["time"].cast<Array>().size();
  for (const auto& [key, value] : columns) {
    const auto name = key.cast<std::string>();
    made.arrays.push_back(value.cast<Array>());
    const double* values = column_or_null(made.arrays.back(), made.log.size, name.c_str());
    const std::size_t number = batch::place_of_reading(name);
    if (number < made.log.numbers.size() && !batch::of_the_clock(name)) {
      made.log.numbers[number] = values;
    } else if (name == "time") {
      made.log.time = values;
    } else if (name == "output_position") {
      made.log.output_position = values;
    } else if (name == "motor_position") {
      made.log.motor_position = values;
    } else {
      refuse("it reads no channel '" + name + "'");
    }
  }
  return made;
}

/// Adds a column to the results; what it is filled through.
template <typename T>
T* column(py::dict& results, std::string_view name, std::size_t size) {
  py::array_t<T> values(static_cast<py::ssize_t>(size));
  results[py::str(std::string(name))] = values;
  return values.mutable_data();
}

py::dict run(const LogJoint& joint, const py::dict& columns, const std::vector<std::size_t>& starts,
             bool inputs) {
  const JointColumns in = borrow_readings(columns, starts);
  const std::size_t size = in.log.size;
  if (!std::is_sorted(starts.begin(), starts.end()) ||
      (size > 0 && (starts.empty() || starts.front() != 0 || starts.back() >= size))) {
    refuse("starts are rows of the log that rise from 0");
  }
  py::dict results;
  batch::JointResults to;
  to.temperature = column<double>(results, "temperature", size);
  to.sensor_torque = column<double>(results, "sensor_torque", size);
  const Stage all = batch::configured(joint.sensing);
  for (std::size_t k = 0; k < to.outputs.size(); ++k) {
    const auto& output = batch::joint_outputs[k];
    if (has(all, output.by)) to.outputs[k] = column<double>(results, output.name, size);
  }
  for (std::size_t k = 0; inputs && k < to.inputs.size(); ++k) {
    to.inputs[k] = column<double>(results, batch::joint_inputs[k].name, size);
  }
  if (joint.estimating.adaptation) {
    const auto rows = static_cast<py::ssize_t>(size);
    const auto most = static_cast<py::ssize_t>(LogJoint::Adapting::most);
    py::array_t<double> values({rows, most});
    results["adapted"] = values;
    to.adapted = values.mutable_data();
    to.told = column<std::uint8_t>(results, "told", size);
  }
  if (has(all, Stage::collision)) to.contact = column<std::uint8_t>(results, "contact", size);
  to.flags = column<std::uint8_t>(results, "flags", size);
  to.faults = column<std::uint8_t>(results, "faults", size);
  to.missed = column<std::uint16_t>(results, "missed", size);
  {
    const py::gil_scoped_release release;
    batch::replay_joint(joint, in.log, to);
  }
  return results;
}

}  // namespace

void bind_joint(py::module_& module) {
  py::class_<LogJoint>(module, "Joint",
                       "From raw readings to the external torque and a contact, as on the device.")
      .def(py::init(&joint_from), py::arg("stages"), py::arg("models") = Models{}, py::kw_only(),
           py::arg("effective_ratio") = 1.0, py::arg("inertia") = 0.0,
           py::arg("link_inertia") = 0.0, py::arg("low") = std::numeric_limits<double>::lowest(),
           py::arg("high") = std::numeric_limits<double>::max(), py::arg("limits") = Limits{},
           R"(`stages` as model.json has them; `models` by 'sensor', 'observed', 'torsion' and
'carried': a design and its coefficients; inertias [kg m² at the output]; parts were fitted
between temperatures `low` and `high` [°C]; `limits` of readings that have other ones than
those of `reading_limits`.)")
      .def("run", &run, py::arg("columns"), py::arg("starts"), py::arg("inputs") = false,
           R"(Results of each row by name, for the stages that the joint has; NaN in rows that a
stage missed. It starts anew at the rows `starts`, which rise from 0.

'missed': 1 thermistor, 2 temperature_compensation, 4 sensor, 8 observer, 16 compliance,
32 merge, 64 collision, 128 compliant_observer, 256 differentiator. 'flags': 1 extrapolated,
2 saturated, 4 a reading beyond its limit. 'faults', of limits and reading_checks: 1 sensor,
2 motor, 4 speed, 8 motion, 16 encoders, 32 where sensor and observer disagree,
64 temperature. `inputs`: also what the stages read, 'velocity', 'momentum', 'motor_torque'
at the output, 'observer_intrinsic', 'torsion', 'gear_known', 'link_momentum'. Of a joint
that adapts 'adapted': the first eight coefficients of the observed model behind each row, 0
where it has fewer, and 'told': directions of them that its last round of blocks told.)");
}

}  // namespace flexspline::bindings
