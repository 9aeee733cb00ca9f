/// One effect of a drive that is driven forward, with its coefficients.
#pragma once

#include <array>
#include <vector>

#include "host/by_name.hpp"

namespace flexspline::batch::forward {

inline constexpr double sharp = 1e-300;  ///< rad/s, width of the direction
inline constexpr double still = 1e-100;  ///< rad/s, where rows have their limits at rest
inline constexpr std::size_t most_memories = 2;

using Memories = std::array<AnyState, most_memories>;

/// One effect of the drive.
struct Member {
  AnyEffect effect;
  std::vector<double> coefficients;
  std::size_t memory = 0;  ///< its place among the memories, where it remembers
  bool carries = false;    ///< part of the transmitted load
};

template <typename Test>
bool holds(const AnyEffect& any, Test test) {
  return std::visit(
      [&]<typename Effect>(const Effect&) { return test.template operator()<Effect>(); }, any);
}
inline bool reads_channel(const AnyEffect& any, Channel channel) {
  return holds(any, [channel]<typename Effect>() { return reads<Effect>(channel); });
}

/// row · coefficients of one effect.
template <typename Effect>
double torque_of(const Effect& effect, const Sample<double>& at, const double* coefficients,
                 [[maybe_unused]] AnyState& memory) noexcept {
  NoState none;
  double sum = 0;
  const auto add = [&](const auto& row, std::size_t terms) {
    for (std::size_t k = 0; k < terms; ++k) sum += row[k] * coefficients[k];
  };
  if constexpr (Remembers<Effect>) {
    add(effect.row(at, *std::get_if<place_of<Effect>>(&memory)), effect.terms.size());
  } else if constexpr (HarmonicEffect<Effect>) {
    add(row_of(effect, at, none), 2 * effect.harmonics().size());
  } else {
    add(row_of(effect, at, none), effect.terms.size());
  }
  return sum;
}

inline double torque_of(const Member& member, const Sample<double>& at,
                        Memories& memories) noexcept {
  return std::visit(
      [&](const auto& effect) {
        return torque_of(effect, at, member.coefficients.data(), memories[member.memory]);
      },
      member.effect);
}

}  // namespace flexspline::batch::forward
