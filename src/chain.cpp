#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>

#include "bindings.hpp"
#include "flexspline/batch/replay_chain.hpp"

namespace flexspline::bindings {
namespace {

using Config = batch::LogChain::Config;

[[noreturn]] void refuse(const std::string& sentence) {
  throw std::invalid_argument("chain: " + sentence);
}

/// An entry of the chain's configuration: the fields of one estimator in model.json.
struct Entry {
  std::string name;
  py::dict fields;

  template <typename T>
  T get(const char* field) const {
    if (!fields.contains(field)) refuse("'" + name + "' lacks '" + field + "'");
    return fields[field].cast<T>();
  }
  double number(const char* field) const { return get<double>(field); }

  /// (low, high), or everything where it is None or missing.
  void range(const char* field, double& low, double& high) const {
    if (!fields.contains(field) || fields[field].is_none()) return;
    const auto pair = get<std::pair<double, double>>(field);
    low = pair.first;
    high = pair.second;
  }

  /// The place of a word among those that are known.
  template <typename Enum, std::size_t N>
  Enum choice(const char* field, const std::array<const char*, N>& words) const {
    const auto word = get<std::string>(field);
    for (std::size_t k = 0; k < N; ++k) {
      if (word == words[k]) return static_cast<Enum>(k);
    }
    refuse("'" + name + "' does not know " + field + " '" + word + "'");
  }

  template <std::size_t N>
  void fill(const char* field, std::array<double, N>& into) const {
    const auto values = get<std::vector<double>>(field);
    if (values.size() > N) {
      refuse("'" + name + "' has " + std::to_string(values.size()) + " " + field +
             ", room is for " + std::to_string(N));
    }
    std::copy(values.begin(), values.end(), into.begin());
  }
};

void read_thermistor(const Entry& entry, Config& config) {
  config.thermistor = {entry.number("supply_voltage"), entry.number("divider_resistance"),
                       entry.number("nominal_resistance"), entry.number("beta"),
                       entry.number("nominal_temperature")};
}

void read_compensation(const Entry& entry, Config& config) {
  auto& made = config.compensation.emplace();
  entry.fill("coefficients", made.coefficients);
  made.reference_temperature = entry.number("reference_temperature");
  made.gradient = entry.number("gradient");
  made.thermal_lag = entry.number("thermal_lag");
  entry.range("temperature_range", made.low, made.high);
}

void read_calibration(const Entry& entry, Config& config) {
  auto& made = config.calibration.emplace();
  made.sensitivity = entry.number("sensitivity");
  made.zero = entry.number("zero");
  entry.range("voltage_range", made.low, made.high);
}

MomentumObserver<double>::Config observer_from(const Entry& entry) {
  return {entry.number("gain"),
          entry.choice<Discretisation>("discretisation", std::array{"exact", "euler"})};
}

void read_observer(const Entry& entry, Config& config) {
  config.observer = observer_from(entry);
  config.observer_input =
      entry.choice<ObserverInput>("input", std::array{"sensor_torque", "motor_torque"});
}

void read_compliant_observer(const Entry& entry, Config& config) {
  config.compliant_observer = observer_from(entry);
}

void read_compliance(const Entry& entry, Config& config) {
  config.compliance = {entry.number("mesh_stiffness"), entry.number("mesh_shape"),
                       entry.number("margin")};
  if (!entry.fields.contains("hysteresis")) return;
  const Entry loop{"hysteresis", entry.get<py::dict>("hysteresis")};
  config.hysteresis.emplace().load_width = loop.number("load_width");
  loop.fill("heights", config.hysteresis->heights);
}

void read_merge(const Entry& entry, Config& config) {
  enum class Method : unsigned char { logistic, kalman };
  if (entry.fields.contains("at_rest")) {
    config.at_rest =
        entry.choice<AtRest>("at_rest", std::array{"compliance", "compliant_observer"});
  }
  const LogisticMerge<double> logistic{entry.number("alpha"), entry.number("transition_velocity")};
  if (entry.choice<Method>("method", std::array{"logistic", "kalman"}) == Method::logistic) {
    config.logistic = logistic;
    return;
  }
  const auto observer = entry.get<std::pair<double, double>>("observer_noise");
  const auto compliance = entry.get<std::pair<double, double>>("compliance_noise");
  config.kalman = {logistic,        entry.number("walk"), observer.first,
                   observer.second, compliance.first,     compliance.second};
}

void read_collision(const Entry& entry, Config& config) {
  auto& made = config.collision.emplace();
  entry.fill("negative", made.negative);
  entry.fill("positive", made.positive);
  entry.fill("speed_edges", made.speed_edges);
  made.release = entry.number("release");
  made.hold = entry.number("hold");
  config.watched = entry.choice<Watched>(
      "input", std::array{"observer", "sensor", "merged", "compliant_observer"});
}

Config config_from(const py::dict& entries) {
  static const std::map<std::string, void (*)(const Entry&, Config&)> readers{
      {"thermistor", read_thermistor},
      {"temperature_compensation", read_compensation},
      {"calibration", read_calibration},
      {"observer", read_observer},
      {"compliance", read_compliance},
      {"compliant_observer", read_compliant_observer},
      {"merge", read_merge},
      {"collision", read_collision}};
  Config config;
  for (const auto& [key, value] : entries) {
    const auto name = key.cast<std::string>();
    if (name == "sensor") {
      config.sensor = value.cast<bool>();
      continue;
    }
    const auto found = readers.find(name);
    if (found == readers.end()) refuse("there is no stage '" + name + "'");
    found->second({name, value.cast<py::dict>()}, config);
  }
  return config;
}

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
  py::array_t<std::uint8_t> missed(size);
  py::array_t<bool> contact(size);
  const batch::ChainRun rows{count,
                             in.time,
                             in.inputs,
                             outputs,
                             flags.mutable_data(),
                             missed.mutable_data(),
                             contact.mutable_data()};
  {
    const py::gil_scoped_release release;
    batch::replay_chain(config, rows);
  }
  results["flags"] = flags;
  results["missed"] = missed;
  if (config.collision) results["contact"] = contact;
  return results;
}

}  // namespace

void bind_chain(py::module_& module) {
  py::class_<Config>(module, "Chain",
                     "From raw channels to the external torque and a contact, as on the device.")
      .def(py::init(&config_from), py::arg("config"))
      .def("run", &run, py::arg("columns"), py::arg("size"),
           R"(Results of each row by name, for the stages that the chain has.

A stage that misses a row keeps its last good values, NaN before the first, and sets its bit
in 'missed': 1 thermistor, 2 temperature_compensation, 4 sensor, 8 observer, 16 compliance,
32 merge, 64 collision, 128 compliant_observer. 'flags': 1 extrapolated, 2 saturated. Each
run starts anew.)");
}

}  // namespace flexspline::bindings
