/// What every effect is made of: terms, shapes and a row.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "flexspline/each_place.hpp"
#include "flexspline/sample.hpp"

namespace flexspline {

/// The numbers that a coefficient each multiplies; torque = row · coefficients.
template <typename S, std::size_t N>
using Row = std::array<S, N>;

/// row · coefficients, term by term from the left.
template <typename S, std::size_t N>
constexpr S weighted(const Row<S, N>& row, const std::array<S, N>& coefficients) noexcept {
  S sum = -S(0);  // −0 + x is x, bit by bit
  for_each_place<N>([&](std::size_t k) { sum += row[k] * coefficients[k]; });
  return sum;
}

/// A coefficient's name, and its unit where the target is a torque in Nm; effects of the torsion
/// alone state theirs in rad.
struct Term {
  std::string_view name;
  std::string_view unit;
};

/// A field that bends an effect's row; fitted by an outer search, or only stored.
template <typename Effect, typename S>
struct Shape {
  std::string_view name;
  std::string_view unit;
  S Effect::* field;
  S lower;
  S upper;
  bool fitted;  ///< false: a convention, such as a reference temperature
  /// Whose it is: "" this effect's alone; `of_model` all that have it, once; else that of the effect
  /// of this name, where the model has it.
  std::string_view owner{};
};
inline constexpr std::string_view of_model = "model";

/// Half-width of the change of direction, a field that friction effects share.
template <typename Effect, typename S>
constexpr Shape<Effect, S> direction_width_shape() noexcept {
  return {"direction_width", "rad/s", &Effect::direction_width, S(1e-4), S(0.5), true, of_model};
}

/// Temperature at which an effect without its dependence on it holds alone: a convention.
template <typename Effect, typename S>
constexpr Shape<Effect, S> reference_temperature_shape() noexcept {
  return {"reference_temperature", "°C", &Effect::reference_temperature, S(-50), S(150), false};
}

/// What may drive an effect that remembers, and the shape that is its width then. Where an effect
/// has several, its shape `path` is the number of the one in use; it reads that channel alone.
struct Path {
  Channel channel;
  std::string_view width;
};

/// An effect whose row depends on what came before. Its memory is a plain `State`, passed in:
///
///   row(sample, state) -> a few numbers; the state moves on by one sample
///
/// `State{}` has seen nothing: the first sample starts it. A copy saves it, assigning the copy
/// restores it. What is not finite never enters it: a model looks at a sample before its effects
/// do. What the memory was before the first sample is unknown; `settled(state)` says whether the
/// row still depends on that.
template <typename Effect>
concept Remembers = requires { typename Effect::State; };

/// The memory of an effect that has none.
struct NoState {};

template <typename Effect>
struct StateOfEffect {
  using type = NoState;
};
template <Remembers Effect>
struct StateOfEffect<Effect> {
  using type = typename Effect::State;
};
template <typename Effect>
using StateOf = typename StateOfEffect<Effect>::type;

/// Which way the joint moves: −1 … 1, through 0 at rest.
///
///   d(v) = tanh(v / v_d)       by v · (1 / v_d), whose last factor is known beforehand
///
/// The forward simulation lets every `direction_width` go to zero, so that a row is to have it here
/// and nowhere else.
/// The sigmoids of turlapati_intrinsic_dynamics (9) with slope α are (1 ± d)/2, v_d = 2/α.
template <typename S>
constexpr S direction(S velocity, S width) noexcept {
  return math::tanh(velocity * (S(1) / width));
}

}  // namespace flexspline
