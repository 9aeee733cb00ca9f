#include "bindings.hpp"
#include "host/by_name.hpp"

namespace flexspline::bindings {
namespace {

constexpr std::array<const char*, 14> excitation_names{
    "both_directions", "speed_ratio",    "low_speeds",     "acceleration", "turn",
    "resolved_order",  "resolved_poles", "temperature",    "duration",     "known_load",
    "any_load",        "both_torques",   "there_and_back", "motor_torque"};

py::dict traits_of(const Traits& traits) {
  py::dict entry;
  entry["constant"] = traits.constant;
  entry["basic"] = traits.basic;
  entry["inertial"] = traits.inertial;
  entry["carries_load"] = traits.carries_load;
  entry["one_signed"] = traits.one_signed;
  entry["dissipative"] = traits.dissipative;
  entry["loop"] = traits.loop;
  entry["known_load"] = traits.known_load;
  return entry;
}

py::list shapes_of(const batch::AnyEffect& any) {
  py::list shapes;
  batch::for_each_shape(any, [&](const auto& shape, double value) {
    py::dict entry;
    entry["name"] = std::string(shape.name);
    entry["unit"] = std::string(shape.unit);
    entry["default"] = value;
    entry["lower"] = shape.lower;
    entry["upper"] = shape.upper;
    entry["fitted"] = shape.fitted;
    entry["owner"] = std::string(shape.owner);
    shapes.append(entry);
  });
  return shapes;
}

template <typename Effect>
py::dict describe(const Effect& effect) {
  py::dict entry;
  entry["name"] = std::string(effect.name);
  entry["targets"] = std::string(effect.targets);
  entry["signature"] = std::string(effect.signature);
  entry["source"] = std::string(effect.source);
  entry["traits"] = traits_of(Effect::traits);
  entry["remembers"] = Remembers<Effect>;
  entry["modulated"] = ModulatedHarmonicEffect<Effect>;
  entry["reversal"] = std::string(reversal_of<Effect>());
  py::list terms;
  for (const Term& term : effect.terms) {
    terms.append(py::make_tuple(std::string(term.name), std::string(term.unit)));
  }
  entry["terms"] = terms;
  py::list reads;
  for (const Channel channel : effect.reads) {
    reads.append(std::string(channel_names[static_cast<std::size_t>(channel)]));
  }
  entry["reads"] = reads;
  py::list paths;
  for (const Path& path : paths_of<Effect>()) {
    paths.append(py::make_tuple(std::string(channel_names[static_cast<std::size_t>(path.channel)]),
                                std::string(path.width)));
  }
  entry["paths"] = paths;
  py::list demands;
  for (const Demand& demand : Effect::demands) {
    demands.append(py::make_tuple(excitation_names[static_cast<std::size_t>(demand.excitation)],
                                  demand.amount));
  }
  entry["demands"] = demands;
  py::list combines;
  for (const std::string_view name : combines_of<Effect>()) combines.append(std::string(name));
  entry["combines"] = combines;
  py::list pairs;
  if constexpr (HarmonicEffect<Effect>) {
    for (const Pair pair : effect.pairs) pairs.append(std::string(batch::name_of(pair)));
  }
  entry["pairs"] = pairs;
  return entry;
}

}  // namespace

void bind_catalogue(py::module_& module) {
  module.def(
      "catalogue",
      [] {
        py::list all;
        for (const batch::AnyEffect& any : batch::catalogue()) {
          py::dict entry = std::visit([](const auto& effect) { return describe(effect); }, any);
          entry["shapes"] = shapes_of(any);
          all.append(entry);
        }
        return all;
      },
      "Every effect of the core: name, targets, terms, shapes, channels read, pairs of parts.");
  module.attr("max_harmonics") = batch::max_harmonics;
  const auto names = [](const auto& from, auto name) {
    py::tuple all(from.size());
    for (std::size_t k = 0; k < from.size(); ++k) all[k] = py::str(std::string(name(from[k])));
    return all;
  };
  module.attr("numbers") = names(numbers<double>, [](const auto& each) { return each.name(); });
  module.attr("channels") = names(channel_names, [](std::string_view name) { return name; });
  module.attr("instruments") =
      names(instruments<double>, [](const auto& each) { return each.name; });
}

}  // namespace flexspline::bindings
