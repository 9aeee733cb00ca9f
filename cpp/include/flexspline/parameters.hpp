/// Every number of a model or a joint that may change in the field, by name and in a fixed order.
///
/// `parameters::visit(visitor, x)` calls for each of them, of a constant x to read, else to change,
///
///   structure(name)                       what is there: an effect, a stage, a rule
///   numbers(name, first, count, range)    `count` numbers of type S, each within `range`
///   harmonic(h), gear(g)                  integers
///
/// The structure is what a program was compiled with: which effects with how many orders, which
/// stages run, by which rule. All else may be replaced while it runs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <tuple>

#include "flexspline/joint.hpp"

namespace flexspline {

/// What a number may be; NaN never.
template <typename S>
struct Range {
  S low = -std::numeric_limits<S>::max();
  S high = std::numeric_limits<S>::max();

  constexpr bool has(S value) const noexcept { return value >= low && value <= high; }
};

namespace parameters {

template <typename S>
inline constexpr Range<S> finite{};
template <typename S>
inline constexpr Range<S> not_negative{S(0)};
template <typename S>
inline constexpr Range<S> positive{std::numeric_limits<S>::min()};
/// Bands of speed that are not in use end at infinity.
template <typename S>
inline constexpr Range<S> edge{S(0), std::numeric_limits<S>::infinity()};

template <typename V, typename T, typename S>
constexpr void one(V& visitor, std::string_view name, T& value, Range<S> range) noexcept {
  visitor.numbers(name, &value, 1, range);
}
template <typename V, typename T, typename S>
constexpr void all(V& visitor, std::string_view name, T& values, Range<S> range) noexcept {
  visitor.numbers(name, values.data(), values.size(), range);
}

/// Orders are handed over together: how each is reached depends on those before it.
template <typename V, typename Effect>
constexpr void visit_harmonics(V& visitor, Effect& effect) noexcept {
  const auto known = effect.harmonics();
  std::array<Harmonic, Effect::most> taken{};
  std::copy(known.begin(), known.end(), taken.begin());
  const std::span harmonics = std::span(taken).first(known.size());
  for (Harmonic& harmonic : harmonics) visitor.harmonic(harmonic);
  if constexpr (!std::is_const_v<Effect>) effect.assign(harmonics);
}

template <typename S, typename V, typename Part>
constexpr void visit_effect(V& visitor, Part& part) noexcept {
  using Effect = std::remove_cvref_t<decltype(part.effect)>;
  visitor.structure(Effect::name);
  if constexpr (HarmonicEffect<Effect>) {
    visit_harmonics(visitor, part.effect);
  }
  if constexpr (requires { Effect::shapes(); }) {
    for (const auto& shape : Effect::shapes()) {
      one(visitor, shape.name, part.effect.*shape.field, Range<S>{shape.lower, shape.upper});
    }
  }
  all(visitor, "coefficients", part.coefficients, finite<S>);
}

template <typename S, typename V, typename Parts>
constexpr void visit_model(V& visitor, std::string_view name, Parts& model) noexcept {
  visitor.structure(name);
  visitor.gear(model.gear);
  std::apply([&](auto&... part) { (visit_effect<S>(visitor, part), ...); }, model.parts);
}

template <typename S, typename V, typename T>
constexpr void visit_checks(V& visitor, T& checks) noexcept {
  visitor.structure("reading_checks");
  one(visitor, "least_voltage", checks.least_voltage, finite<S>);
  one(visitor, "most_voltage", checks.most_voltage, finite<S>);
  one(visitor, "least_thermistor_voltage", checks.least_thermistor_voltage, finite<S>);
  one(visitor, "most_thermistor_voltage", checks.most_thermistor_voltage, finite<S>);
  one(visitor, "least_temperature", checks.least_temperature, finite<S>);
  one(visitor, "most_temperature", checks.most_temperature, finite<S>);
  one(visitor, "most_sensor_torque", checks.most_sensor_torque, positive<S>);
  one(visitor, "most_motor_torque", checks.most_motor_torque, positive<S>);
  one(visitor, "most_speed", checks.most_speed, positive<S>);
  one(visitor, "most_acceleration", checks.most_acceleration, positive<S>);
  one(visitor, "way", checks.way, not_negative<S>);
  one(visitor, "twist", checks.twist, not_negative<S>);
  one(visitor, "forget", checks.forget, positive<S>);
  one(visitor, "apart", checks.apart, positive<S>);
  visitor.gear(checks.gear);
}

constexpr std::string_view name_of(Derivatives made) noexcept {
  constexpr std::array<std::string_view, 3> names{"velocity", "acceleration", "both"};
  return names[static_cast<std::size_t>(made)];
}
template <typename S, typename V, typename T>
constexpr void visit_differentiator(V& visitor, T& differentiator) noexcept {
  visitor.structure("differentiator");
  visitor.structure(name_of(differentiator.makes));
  one(visitor, "bandwidth", differentiator.bandwidth, positive<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_thermistor(V& visitor, T& thermistor) noexcept {
  visitor.structure("thermistor");
  one(visitor, "supply_voltage", thermistor.supply_voltage, positive<S>);
  one(visitor, "divider_resistance", thermistor.divider_resistance, positive<S>);
  one(visitor, "nominal_resistance", thermistor.nominal_resistance, positive<S>);
  one(visitor, "beta", thermistor.beta, positive<S>);
  one(visitor, "nominal_temperature", thermistor.nominal_temperature, finite<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_compensation(V& visitor, T& compensation) noexcept {
  visitor.structure("temperature_compensation");
  one(visitor, "reference_temperature", compensation.reference_temperature, finite<S>);
  all(visitor, "coefficients", compensation.coefficients, finite<S>);
  one(visitor, "gradient", compensation.gradient, finite<S>);
  one(visitor, "thermal_lag", compensation.thermal_lag, not_negative<S>);
  one(visitor, "low", compensation.low, finite<S>);
  one(visitor, "high", compensation.high, finite<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_calibration(V& visitor, T& calibration) noexcept {
  visitor.structure("calibration");
  one(visitor, "sensitivity", calibration.sensitivity, finite<S>);
  one(visitor, "zero", calibration.zero, finite<S>);
  one(visitor, "low", calibration.low, finite<S>);
  one(visitor, "high", calibration.high, finite<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_observer(V& visitor, std::string_view name, T& observer) noexcept {
  visitor.structure(name);
  visitor.structure(observer.discretisation == Discretisation::exact ? "exact" : "euler");
  one(visitor, "gain", observer.gain, positive<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_compliance(V& visitor, T& compliance) noexcept {
  visitor.structure("compliance");
  one(visitor, "mesh_stiffness", compliance.mesh_stiffness, positive<S>);
  one(visitor, "mesh_shape", compliance.mesh_shape, not_negative<S>);
  one(visitor, "margin", compliance.margin, Range<S>{std::numeric_limits<S>::min(), S(1)});
}

template <typename S, typename V, typename T>
constexpr void visit_hysteresis(V& visitor, T& hysteresis) noexcept {
  visitor.structure("hysteresis");
  one(visitor, "load_width", hysteresis.load_width, positive<S>);
  all(visitor, "heights", hysteresis.heights, finite<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_logistic(V& visitor, T& merge) noexcept {
  visitor.structure("logistic");
  one(visitor, "alpha", merge.alpha, positive<S>);
  one(visitor, "transition_velocity", merge.transition_velocity, not_negative<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_kalman(V& visitor, T& merge) noexcept {
  visitor.structure("kalman");
  visit_logistic<S>(visitor, merge.motion);
  one(visitor, "walk", merge.walk, positive<S>);
  one(visitor, "observer_rest", merge.observer_rest, positive<S>);
  one(visitor, "observer_motion", merge.observer_motion, positive<S>);
  one(visitor, "compliance_rest", merge.compliance_rest, positive<S>);
  one(visitor, "compliance_motion", merge.compliance_motion, positive<S>);
}

template <typename S, typename V, typename T>
constexpr void visit_detector(V& visitor, T& detector) noexcept {
  visitor.structure("collision");
  all(visitor, "negative", detector.negative, not_negative<S>);
  all(visitor, "positive", detector.positive, not_negative<S>);
  all(visitor, "speed_edges", detector.speed_edges, edge<S>);
  one(visitor, "release", detector.release, Range<S>{std::numeric_limits<S>::min(), S(1)});
  one(visitor, "hold", detector.hold, not_negative<S>);
}

constexpr std::string_view name_of(ObserverInput input) noexcept {
  return input == ObserverInput::sensor_torque ? "by sensor_torque" : "by motor_torque";
}
constexpr std::string_view name_of(AtRest at_rest) noexcept {
  return at_rest == AtRest::compliance ? "at rest compliance" : "at rest compliant_observer";
}
constexpr std::string_view name_of(Watched watched) noexcept {
  switch (watched) {
    case Watched::observer:
      return "watches observer";
    case Watched::sensor:
      return "watches sensor";
    case Watched::merged:
      return "watches merged";
    case Watched::compliant_observer:
      return "watches compliant_observer";
  }
  return "";
}

/// A stage that is there, by its own visit.
template <typename Stage, typename Visit>
constexpr void where_given(Stage& stage, Visit&& visit) noexcept {
  if (auto* found = given(stage)) visit(*found);
}
template <typename Stage, typename Visit>
constexpr void where_given(const Absent<Stage>&, Visit&&) noexcept {}

template <typename S, typename V, typename Stages>
constexpr void visit_chain(V& v, std::string_view name, Stages& chain) noexcept {
  v.structure(name);
  where_given(chain.checks, [&](auto& made) { visit_checks<S>(v, made); });
  where_given(chain.differentiator, [&](auto& made) { visit_differentiator<S>(v, made); });
  where_given(chain.thermistor, [&](auto& made) { visit_thermistor<S>(v, made); });
  where_given(chain.compensation, [&](auto& made) { visit_compensation<S>(v, made); });
  if (chain.sensor) v.structure("sensor");
  where_given(chain.calibration, [&](auto& made) { visit_calibration<S>(v, made); });
  where_given(chain.observer, [&](auto& made) {
    visit_observer<S>(v, "observer", made);
    v.structure(name_of(chain.observer_input));
  });
  where_given(chain.compliance, [&](auto& made) { visit_compliance<S>(v, made); });
  where_given(chain.hysteresis, [&](auto& made) { visit_hysteresis<S>(v, made); });
  where_given(chain.compliant_observer,
              [&](auto& made) { visit_observer<S>(v, "compliant_observer", made); });
  where_given(chain.kalman, [&](auto& made) { visit_kalman<S>(v, made); });
  where_given(chain.logistic, [&](auto& made) { visit_logistic<S>(v, made); });
  if (given(chain.kalman) || given(chain.logistic)) v.structure(name_of(chain.at_rest));
  where_given(chain.collision, [&](auto& made) {
    visit_detector<S>(v, made);
    v.structure(name_of(chain.watched));
  });
}

template <typename S, typename V, typename T>
constexpr void visit_joint(V& visitor, T& joint) noexcept {
  visit_chain<S>(visitor, "sensing", joint.sensing);
  visit_chain<S>(visitor, "estimating", joint.estimating);
  visit_model<S>(visitor, "sensor model", joint.sensor);
  visit_model<S>(visitor, "observed model", joint.observed);
  visit_model<S>(visitor, "torsion model", joint.torsion);
  visit_model<S>(visitor, "carried model", joint.carried);
  visitor.structure("joint");
  one(visitor, "effective_ratio", joint.effective_ratio, positive<S>);
  one(visitor, "inertia", joint.inertia, not_negative<S>);
  one(visitor, "link_inertia", joint.link_inertia, not_negative<S>);
  one(visitor, "low", joint.low, finite<S>);
  one(visitor, "high", joint.high, finite<S>);
}

template <typename V, typename S, typename... Effects>
constexpr void visit(V& visitor, Model<S, Effects...>& model) noexcept {
  visit_model<S>(visitor, "model", model);
}
template <typename V, typename S, typename... Effects>
constexpr void visit(V& visitor, const Model<S, Effects...>& model) noexcept {
  visit_model<S>(visitor, "model", model);
}
template <typename V, typename S, typename... Models>
constexpr void visit(V& visitor, Joint<S, Models...>& joint) noexcept {
  visit_joint<S>(visitor, joint);
}
template <typename V, typename S, typename... Models>
constexpr void visit(V& visitor, const Joint<S, Models...>& joint) noexcept {
  visit_joint<S>(visitor, joint);
}

/// The number type of a model or a joint.
template <typename T>
struct ScalarOf;
template <typename S, typename... Effects>
struct ScalarOf<Model<S, Effects...>> {
  using type = S;
};
template <typename S, typename... Models>
struct ScalarOf<Joint<S, Models...>> {
  using type = S;
};

}  // namespace parameters
}  // namespace flexspline
