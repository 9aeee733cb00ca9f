#include "stages.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

#include "flexspline/reading_limits.hpp"

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

  /// What a chain chooses by the entry.
  template <typename Enum, std::size_t N>
  Enum chosen(const Choice<Enum, N>& one) const {
    std::array<std::string_view, N> words;
    for (std::size_t k = 0; k < N; ++k) words[k] = one.word(k);
    return choice<Enum>(std::string(one.key).c_str(), words);
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
  config.observer_input = entry.chosen(observer_inputs);
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
  if (entry.has("at_rest")) config.at_rest = entry.chosen(at_rests);
  if (entry.choice<Method>("method", words("logistic", "kalman")) == Method::logistic) {
    entry.fill(config.logistic.emplace());
    return;
  }
  entry.fill(config.kalman.emplace());
  entry.fill(config.kalman->motion);
}

void read_collision(const Entry& entry, Config& config) {
  entry.fill(config.collision.emplace());
  config.watched = entry.chosen(watched_ones);
}

/// The stages whose entry is their fields and no more.
bool read_plain(const Entry& entry, Config& config) {
  bool found = false;
  for_each_stage(
      config,
      [&]<typename Stage>(const StageInfo& info, Stage& stage) {
        if constexpr (!std::is_same_v<Stage, bool>) {
          if (info.key != entry.name || !info.within.empty()) return;
          entry.fill(stage.emplace());
          found = true;
        }
      },
      [](const auto&, auto, bool) {});
  return found;
}

}  // namespace

StagesConfig stages_from(const py::dict& entries) {
  static const std::map<std::string, void (*)(const Entry&, StagesConfig&)> readers{
      {"reading_checks", read_checks},
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
    const Entry entry{name, value.cast<py::dict>()};
    if (const auto found = readers.find(name); found != readers.end()) {
      found->second(entry, config);
    } else if (!read_plain(entry, config)) {
      refuse("there is no stage '" + name + "'");
    }
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

/// The rules that it is compiled for.
template <typename Stage>
py::list rules_of() {
  py::list all;
  for_each_rule<Stage>([&](const auto& rule) {
    py::dict one;
    one["name"] = std::string(rule.name);
    one["type"] = std::string(rule.type);
    all.append(one);
  });
  return all;
}

}  // namespace

void bind_stages(py::module_& module) {
  module.def(
      "stages",
      [] {
        py::dict all;
        const AnyStages<double> none;
        std::string last;
        for_each_stage(
            none,
            [&]<typename Stage>(const StageInfo& info, const Stage&) {
              last = info.key;
              py::dict one;
              one["member"] = std::string(info.member);
              one["type"] = std::string(info.type);
              one["bit"] = static_cast<unsigned>(info.bit);
              one["within"] = std::string(info.within.empty() ? info.key : info.within);
              one["choice"] = py::none();
              one["fields"] = py::list();
              one["rules"] = py::list();
              if constexpr (!std::is_same_v<Stage, bool>) {
                one["fields"] = described<typename Stage::value_type>();
                one["rules"] = rules_of<typename Stage::value_type>();
              }
              all[last.c_str()] = one;
            },
            [&](const auto& choice, auto, bool) {
              py::dict one;
              one["key"] = std::string(choice.key);
              one["member"] = std::string(choice.member);
              one["type"] = std::string(choice.type);
              one["prefix"] = std::string(choice.prefix);
              all[last.c_str()]["choice"] = one;
            });
        return all;
      },
      R"(The stages of a chain in the order of their parameters, a dict each.

'member' of the chain, 'type' in an exported header, 'bit' that says it missed, 'within', the
entry of model.json that holds it, 'rules': 'name', 'type'.
'choice' that the chain makes by it, or None: 'key' in model.json, 'member', 'type' of the
enumerators, 'prefix' of the words in a block.
'fields', its numbers in the core's order: 'name' of the member, 'unit', 'key' in model.json
(two of one key are the two numbers of its list), 'needed' there, 'low' and 'high' that it may
be, 'default', which an array has not.)");
  module.attr("most_adapted") = Adaptation<double>::most;
  module.def(
      "reading_limits", [] { return described<ReadingLimits<double>>(); },
      R"(How large the readings of a joint of which nothing is known may be: 'name', 'unit', 'default'
and what else the fields of `stages` have.)");
}

}  // namespace flexspline::bindings
