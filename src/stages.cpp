#include "stages.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

namespace flexspline::bindings {

void refuse(const std::string& sentence) { throw std::invalid_argument("chain: " + sentence); }

namespace {

using Config = StagesConfig;

/// An entry of the chain's configuration: the fields of one estimator in model.json. It knows which
/// of them were asked for, so that one that nobody reads is refused and not passed over; how it was
/// made (`record`) is for people.
struct Entry {
  std::string name;
  py::dict fields;
  mutable std::set<std::string> known{"record"};

  bool has(const char* field) const {
    known.insert(field);
    return fields.contains(field);
  }

  template <typename T>
  T get(const char* field) const {
    if (!has(field)) refuse("'" + name + "' lacks '" + field + "'");
    return fields[field].cast<T>();
  }
  double number(const char* field) const { return get<double>(field); }

  void require_all_known() const {
    for (const auto& [key, value] : fields) {
      const auto field = key.cast<std::string>();
      if (!known.contains(field)) refuse("'" + name + "' has no '" + field + "'");
    }
  }

  /// (low, high), or everything where it is None or missing.
  void range(const char* field, double& low, double& high) const {
    if (!has(field) || fields[field].is_none()) return;
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

Gear<double> gear_from(const Entry& entry) {
  const auto spline =
      entry.choice<OutputSpline>("output_spline", std::array{"unknown", "circular", "flex"});
  return Gear<double>::from_ratio(entry.number("effective_ratio"), spline,
                                  entry.get<bool>("motor_encoder"));
}

/// Fields that are not there keep what the core has in their place: no limit.
void read_checks(const Entry& entry, Config& config) {
  auto& made = config.checks.emplace();
  entry.range("voltage_range", made.least_voltage, made.most_voltage);
  entry.range("thermistor_voltage_range", made.least_thermistor_voltage,
              made.most_thermistor_voltage);
  entry.range("temperature_range", made.least_temperature, made.most_temperature);
  for (const auto& [name, value] : {std::pair{"most_sensor_torque", &made.most_sensor_torque},
                                    {"most_motor_torque", &made.most_motor_torque},
                                    {"most_speed", &made.most_speed},
                                    {"most_acceleration", &made.most_acceleration},
                                    {"way", &made.way},
                                    {"twist", &made.twist},
                                    {"forget", &made.forget},
                                    {"apart", &made.apart}}) {
    if (entry.has(name)) *value = entry.number(name);
  }
  if (entry.has("gear")) {
    const Entry gear{"gear", entry.get<py::dict>("gear")};
    made.gear = gear_from(gear);
    gear.require_all_known();
  }
}

void read_differentiator(const Entry& entry, Config& config) {
  config.differentiator = {
      entry.number("bandwidth"),
      entry.choice<Derivatives>("makes", std::array{"velocity", "acceleration", "both"})};
}

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
  entry.has("full_scale");  // known: of the figures that people read
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
  enum class Input : unsigned char { compliance };
  entry.choice<Input>("input", std::array{"compliance"});
  entry.has("rotor_inertia");  // known: it is part of the model that the observer is given
  config.compliant_observer = observer_from(entry);
}

void read_compliance(const Entry& entry, Config& config) {
  config.compliance = {entry.number("mesh_stiffness"), entry.number("mesh_shape"),
                       entry.number("margin")};
  if (!entry.has("hysteresis")) return;
  const Entry loop{"hysteresis", entry.get<py::dict>("hysteresis")};
  config.hysteresis.emplace().load_width = loop.number("load_width");
  loop.fill("heights", config.hysteresis->heights);
  loop.require_all_known();
}

void read_merge(const Entry& entry, Config& config) {
  enum class Method : unsigned char { logistic, kalman };
  if (entry.has("at_rest")) {
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

}  // namespace

StagesConfig stages_from(const py::dict& entries) {
  static const std::map<std::string, void (*)(const Entry&, StagesConfig&)> readers{
      {"reading_checks", read_checks},
      {"differentiator", read_differentiator},
      {"thermistor", read_thermistor},
      {"temperature_compensation", read_compensation},
      {"calibration", read_calibration},
      {"observer", read_observer},
      {"compliance", read_compliance},
      {"compliant_observer", read_compliant_observer},
      {"merge", read_merge},
      {"collision", read_collision}};
  StagesConfig config;
  for (const auto& [key, value] : entries) {
    const auto name = key.cast<std::string>();
    if (name == "sensor") {
      config.sensor = value.cast<bool>();
      continue;
    }
    const auto found = readers.find(name);
    if (found == readers.end()) refuse("there is no stage '" + name + "'");
    const Entry entry{name, value.cast<py::dict>()};
    found->second(entry, config);
    entry.require_all_known();
  }
  return config;
}

}  // namespace flexspline::bindings
