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

template <typename... Words>
std::array<std::string_view, sizeof...(Words)> words(Words... all) {
  return {all...};
}

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

  /// The place of a word among those that are known.
  template <typename Enum, std::size_t N>
  Enum choice(const char* field, const std::array<std::string_view, N>& words) const {
    const auto word = get<std::string>(field);
    for (std::size_t k = 0; k < N; ++k) {
      if (word == words[k]) return static_cast<Enum>(k);
    }
    refuse("'" + name + "' does not know " + field + " '" + word + "'");
  }

  /// Takes a number, or one of a list under a key: its place there.
  void take(const auto& field, std::size_t place, double& value) const {
    const std::string key(field.key.empty() ? field.name : field.key);
    if (!field.needed && (!has(key.c_str()) || fields[key.c_str()].is_none())) return;
    if (field.key.empty()) {
      value = number(key.c_str());
    } else {
      const auto pair = get<std::pair<double, double>>(key.c_str());
      value = place == 0 ? pair.first : pair.second;
    }
  }
  template <std::size_t N>
  void take(const auto& field, std::size_t, std::array<double, N>& into) const {
    const std::string key(field.name);
    const auto values = get<std::vector<double>>(key.c_str());
    if (values.size() > N) {
      refuse("'" + name + "' has " + std::to_string(values.size()) + " " + key + ", room is for " +
             std::to_string(N));
    }
    std::copy(values.begin(), values.end(), into.begin());
  }

  /// All fields and rules of a stage; fields that may be left out keep what they have.
  template <typename Stage>
  void fill(Stage& stage) const {
    std::string_view before;
    for_each_rule<Stage>([&](const auto& rule) {
      using Enum = std::remove_cvref_t<decltype(stage.*rule.member)>;
      stage.*rule.member = choice<Enum>(std::string(rule.name).c_str(), rule.words);
    });
    for_each_field<Stage>([&](const auto& field) {
      take(field, !field.key.empty() && field.key == before ? 1 : 0, stage.*field.member);
      before = field.key;
    });
  }
};

Gear<double> gear_from(const Entry& entry) {
  const auto spline =
      entry.choice<OutputSpline>("output_spline", words("unknown", "circular", "flex"));
  return Gear<double>::from_ratio(entry.number("effective_ratio"), spline,
                                  entry.get<bool>("motor_encoder"));
}

void read_checks(const Entry& entry, Config& config) {
  auto& made = config.checks.emplace();
  entry.fill(made);
  if (!entry.has("gear")) return;
  const Entry gear{"gear", entry.get<py::dict>("gear")};
  made.gear = gear_from(gear);
  gear.require_all_known();
}

void read_calibration(const Entry& entry, Config& config) {
  entry.fill(config.calibration.emplace());
  entry.has("full_scale");  // known: of the figures that people read
}

void read_observer(const Entry& entry, Config& config) {
  entry.fill(config.observer.emplace());
  config.observer_input =
      entry.choice<ObserverInput>("input", words("sensor_torque", "motor_torque"));
}

void read_compliant_observer(const Entry& entry, Config& config) {
  enum class Input : unsigned char { compliance };
  entry.choice<Input>("input", words("compliance"));
  entry.has("rotor_inertia");  // known: it is part of the model that the observer is given
  entry.fill(config.compliant_observer.emplace());
}

void read_compliance(const Entry& entry, Config& config) {
  entry.fill(config.compliance.emplace());
  if (!entry.has("hysteresis")) return;
  const Entry loop{"hysteresis", entry.get<py::dict>("hysteresis")};
  loop.fill(config.hysteresis.emplace());
  loop.require_all_known();
}

void read_merge(const Entry& entry, Config& config) {
  enum class Method : unsigned char { logistic, kalman };
  if (entry.has("at_rest")) {
    config.at_rest = entry.choice<AtRest>("at_rest", words("compliance", "compliant_observer"));
  }
  if (entry.choice<Method>("method", words("logistic", "kalman")) == Method::logistic) {
    entry.fill(config.logistic.emplace());
    return;
  }
  entry.fill(config.kalman.emplace());
  entry.fill(config.kalman->motion);
}

void read_collision(const Entry& entry, Config& config) {
  entry.fill(config.collision.emplace());
  config.watched =
      entry.choice<Watched>("input", words("observer", "sensor", "merged", "compliant_observer"));
}

/// A stage whose entry is its fields and no more.
template <auto stage>
void read_plain(const Entry& entry, Config& config) {
  entry.fill((config.*stage).emplace());
}

}  // namespace

StagesConfig stages_from(const py::dict& entries) {
  static const std::map<std::string, void (*)(const Entry&, StagesConfig&)> readers{
      {"reading_checks", read_checks},
      {"differentiator", read_plain<&Config::differentiator>},
      {"thermistor", read_plain<&Config::thermistor>},
      {"temperature_compensation", read_plain<&Config::compensation>},
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

namespace {

/// What a stage is set up with, for people and writers: a dict of each field.
template <typename Stage>
py::list described(const Stage& made = {}) {
  py::list all;
  for_each_field<Stage>([&](const auto& field) {
    py::dict one;
    one["name"] = std::string(field.name);
    one["unit"] = std::string(field.unit);
    one["key"] = std::string(field.key.empty() ? field.name : field.key);
    one["needed"] = field.needed;
    one["low"] = field.range.low;
    one["high"] = field.range.high;
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(made.*field.member)>, double>) {
      one["default"] = made.*field.member;
    }
    all.append(one);
  });
  return all;
}

}  // namespace

void bind_stages(py::module_& module) {
  module.def(
      "stage_fields",
      [] {
        py::dict all;
        all["reading_checks"] = described<ReadingChecks<double>::Config>();
        all["differentiator"] = described<Differentiator<double>::Config>();
        all["thermistor"] = described<Thermistor<double>>();
        all["temperature_compensation"] = described<TemperatureCompensation<double>::Config>();
        all["calibration"] = described<Calibration<double>>();
        all["observer"] = described<MomentumObserver<double>::Config>();
        all["compliance"] = described<Compliance<double>>();
        all["hysteresis"] = described<LoadHysteresis<double>>();
        all["logistic"] = described<LogisticMerge<double>>();
        all["kalman"] = described<KalmanMerge<double>::Config>();
        all["collision"] = described<CollisionDetector<double>::Config>();
        return all;
      },
      R"(The numbers of each stage in the core's order: dicts of 'name' of the member, 'unit', 'key'
in model.json (two of one key are the two numbers of its list), 'needed' there, 'low' and 'high'
that it may be, 'default', which an array has not.)");
}

}  // namespace flexspline::bindings
