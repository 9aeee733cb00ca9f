/// What a stage is set up with: each of its numbers once, with name, unit, range and member.
///
/// A stage says `fields()`, a tuple of `Field`, and where a program is compiled for one of several
/// rules `rules()`, a tuple of `Rule`. What reads or writes a stage follows from them, in their
/// order: parameters that change in the field (parameters.hpp), and on a PC its bindings, the
/// exported header and the block.
#pragma once

#include <array>
#include <limits>
#include <string_view>
#include <tuple>

namespace flexspline {

/// What a number may be; NaN never.
template <typename S>
struct Range {
  S low = -std::numeric_limits<S>::max();
  S high = std::numeric_limits<S>::max();

  constexpr bool has(S value) const noexcept { return value >= low && value <= high; }
};

template <typename S>
inline constexpr Range<S> finite{};
template <typename S>
inline constexpr Range<S> not_negative{S(0)};
template <typename S>
inline constexpr Range<S> positive{std::numeric_limits<S>::min()};
/// A share of something, above zero.
template <typename S>
inline constexpr Range<S> part_of_one{std::numeric_limits<S>::min(), S(1)};
/// Bands of speed that are not in use end at infinity.
template <typename S>
inline constexpr Range<S> edge{S(0), std::numeric_limits<S>::infinity()};

/// A number of a stage, or several in an array.
template <typename Stage, typename Value, typename S>
struct Field {
  std::string_view name;  ///< of the member
  std::string_view unit;
  Value Stage::* member;
  Range<S> range;
  /// In model.json, where it is another one. Two fields of one key are the two numbers of its list.
  std::string_view key{};
  bool needed = true;  ///< in model.json; else it keeps what it has
};

/// A rule that a program is compiled for, and its words in the order of the enumerators.
template <typename Stage, typename Enum, std::size_t N>
struct Rule {
  std::string_view name;
  std::string_view type;  ///< of the enumerators, in an exported header
  Enum Stage::* member;
  std::array<std::string_view, N> words;

  constexpr std::string_view word(const Stage& stage) const noexcept {
    return words[static_cast<std::size_t>(stage.*member)];
  }
};

// For Clang before 17, which deduces nothing of an aggregate by itself.
template <typename Stage, typename Value, typename S>
Field(std::string_view, std::string_view, Value Stage::*, Range<S>, std::string_view = {},
      bool = true) -> Field<Stage, Value, S>;
template <typename Stage, typename Enum, std::size_t N>
Rule(std::string_view, std::string_view, Enum Stage::*, std::array<std::string_view, N>)
    -> Rule<Stage, Enum, N>;

/// Calls use(field) for each field of a stage; what it throws on a PC goes on to the caller.
template <typename Stage, typename Use>
constexpr void for_each_field(Use&& use) {
  std::apply([&](const auto&... field) { (use(field), ...); }, Stage::fields());
}

/// Calls use(rule) for each rule of a stage.
template <typename Stage, typename Use>
constexpr void for_each_rule([[maybe_unused]] Use&& use) {
  if constexpr (requires { Stage::rules(); }) {
    std::apply([&](const auto&... rule) { (use(rule), ...); }, Stage::rules());
  }
}

}  // namespace flexspline
