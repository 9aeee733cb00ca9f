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

#include "flexspline/fields.hpp"
#include "flexspline/joint.hpp"

namespace flexspline {

namespace parameters {

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

/// A stage by its name: its rules, then its numbers.
template <typename V, typename Stage>
constexpr void visit_stage(V& visitor, std::string_view name, Stage& stage) noexcept {
  using Its = std::remove_const_t<Stage>;
  visitor.structure(name);
  for_each_rule<Its>([&](const auto& rule) { visitor.structure(rule.word(stage)); });
  if constexpr (requires { stage.motion; }) visit_stage(visitor, "logistic", stage.motion);
  for_each_field<Its>([&](const auto& field) {
    auto& value = stage.*field.member;
    if constexpr (requires { value.data(); }) {
      all(visitor, field.name, value, field.range);
    } else {
      one(visitor, field.name, value, field.range);
    }
  });
  if constexpr (requires { stage.gear; }) visitor.gear(stage.gear);
}

/// A stage that is there, by its own visit.
template <typename Stage, typename Visit>
constexpr void where_given(Stage& stage, Visit&& visit) noexcept {
  if (auto* found = given(stage)) visit(*found);
}
template <typename Stage, typename Visit>
constexpr void where_given(const Absent<Stage>&, Visit&&) noexcept {}

template <typename Visit>
constexpr void where_given(bool there, Visit&& visit) noexcept {
  if (there) visit(there);
}

template <typename V, typename Stages>
constexpr void visit_chain(V& v, std::string_view name, Stages& chain) noexcept {
  v.structure(name);
  for_each_stage(
      chain,
      [&v](const StageInfo& info, auto& stage) {
        where_given(stage, [&](auto& made) {
          if constexpr (std::is_same_v<std::remove_cvref_t<decltype(made)>, bool>) {
            v.structure(info.key);
          } else {
            visit_stage(v, info.key, made);
          }
        });
      },
      [&v](const auto& choice, auto value, bool asked) {
        if (asked) v.structure(choice.structure[static_cast<std::size_t>(value)]);
      });
}

template <typename S, typename V, typename T>
constexpr void visit_joint(V& visitor, T& joint) noexcept {
  visit_chain(visitor, "sensing", joint.sensing);
  visit_chain(visitor, "estimating", joint.estimating);
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

/// The number type of a model or a joint.
template <typename T>
struct ScalarOf;
template <typename S, typename... Effects>
struct ScalarOf<Model<S, Effects...>> {
  using type = S;
  static constexpr bool is_model = true;
};
template <typename S, typename... Models>
struct ScalarOf<Joint<S, Models...>> {
  using type = S;
  static constexpr bool is_model = false;
};

/// All but the limits of readings.
template <typename V, typename T>
constexpr void visit_unlimited(V& visitor, T& made) noexcept {
  using Its = ScalarOf<std::remove_const_t<T>>;
  if constexpr (Its::is_model) {
    visit_model<typename Its::type>(visitor, "model", made);
  } else {
    visit_joint<typename Its::type>(visitor, made);
  }
}

/// The limits of readings: of a joint all, of a model those of the channels that it reads.
template <typename V, typename T>
constexpr void visit_limits(V& visitor, T& made) noexcept {
  using Its = ScalarOf<std::remove_const_t<T>>;
  if constexpr (Its::is_model) {
    visitor.structure("limits");
    for (std::size_t k = 0; k < made.limits.channels.size(); ++k) {
      const auto name = channel_names[static_cast<std::size_t>(made.limits.channels[k])];
      one(visitor, name, made.limits.most[k], positive<typename Its::type>);
    }
  } else {
    visit_stage(visitor, "limits", made.limits);
  }
}

template <typename V, typename T>
constexpr void visit(V& visitor, T&& made) noexcept {
  visit_unlimited(visitor, made);
  visit_limits(visitor, made);
}

}  // namespace parameters
}  // namespace flexspline
