/// Effects by their names: how files and scripting languages reach the catalogue.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "host/design.hpp"

namespace flexspline::batch {

/// The catalogue as a list of effects with their default shapes.
inline const std::vector<AnyEffect>& catalogue() {
  static const std::vector<AnyEffect> all = []<std::size_t... I>(std::index_sequence<I...>) {
    return std::vector<AnyEffect>{AnyEffect(std::in_place_index<I>)...};
  }(std::make_index_sequence<std::variant_size_v<AnyEffect>>());
  return all;
}

inline std::string_view name_of(const AnyEffect& any) {
  return std::visit([](const auto& e) { return std::string_view(e.name); }, any);
}

/// The effect of that name with its default shapes; std::invalid_argument if there is none.
inline AnyEffect effect_by_name(std::string_view name) {
  for (const AnyEffect& any : catalogue()) {
    if (name_of(any) == name) return any;
  }
  throw std::invalid_argument("there is no effect named '" + std::string(name) + "'");
}

/// Calls use(shape description, field) for each shape of the effect.
template <typename Any, typename Use>
void for_each_shape(Any& any, Use&& use) {
  std::visit(
      [&](auto& effect) {
        if constexpr (requires { effect.shapes(); }) {
          for (const auto& shape : effect.shapes()) use(shape, effect.*(shape.field));
        }
      },
      any);
}

/// Sets one shape; std::invalid_argument if the effect has none of that name.
inline void set_shape(AnyEffect& any, std::string_view name, double value) {
  bool found = false;
  for_each_shape(any, [&](const auto& shape, double& field) {
    if (shape.name == name) {
      field = value;
      found = true;
    }
  });
  if (!found) {
    throw std::invalid_argument("effect '" + std::string(name_of(any)) + "' has no shape '" +
                                std::string(name) + "'");
  }
}

inline constexpr std::array<std::pair<std::string_view, Pair>, 4> pair_names{{
    {"output_on_housing", Pair::output_on_housing},
    {"motor_on_stator", Pair::motor_on_stator},
    {"wave_generator_on_flexspline", Pair::wave_generator_on_flexspline},
    {"wave_generator_on_circular_spline", Pair::wave_generator_on_circular_spline},
}};

inline Pair pair_by_name(std::string_view name) {
  for (const auto& [known, pair] : pair_names) {
    if (known == name) return pair;
  }
  throw std::invalid_argument("there is no pair of parts named '" + std::string(name) + "'");
}

inline std::string_view name_of(Pair pair) {
  for (const auto& [name, known] : pair_names) {
    if (known == pair) return name;
  }
  return "";
}

/// Sets the orders of a ripple effect; std::invalid_argument for other effects, for pairs that
/// the effect does not own and for more than max_harmonics.
inline void set_harmonics(AnyEffect& any, std::span<const Harmonic> harmonics) {
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument("effect '" + std::string(name_of(any)) + "' " + why);
  };
  std::visit(
      [&](auto& effect) {
        if constexpr (HarmonicEffect<std::remove_cvref_t<decltype(effect)>>) {
          if (harmonics.size() > max_harmonics) {
            refuse("takes at most " + std::to_string(max_harmonics) + " orders");
          }
          for (const Harmonic& harmonic : harmonics) {
            if (std::find(effect.pairs.begin(), effect.pairs.end(), harmonic.pair) ==
                effect.pairs.end()) {
              refuse("has no orders of '" + std::string(name_of(harmonic.pair)) + "'");
            }
          }
          effect.assign(harmonics);
        } else if (!harmonics.empty()) {
          refuse("has no orders");
        }
      },
      any);
}

}  // namespace flexspline::batch
