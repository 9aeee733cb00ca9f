/// Symmetric compositions of drifts and kicks: how long each of a step's parts is.
///
///   drift(move₀ h) kick(push₀ h) drift(move₁ h) … kick(pushₙ₋₁ h) drift(moveₙ h)
///
/// Both read the same backwards, so a step without losses is undone by turning the velocities
/// round, and both hold where a kick depends on velocity. Order 4: four kicks, on an oscillator
/// the frequency is wrong by 6.1e-5 (ω h)⁴ of itself, stable while ω h < 2.98. Order 6: ten
/// kicks, 1.5e-7 (ω h)⁶, stable while ω h < 3.13; for equal error below 1e-5 it needs fewer
/// kicks. Numbers: from the trace of a step's matrix.
/// Source: order 4: [Omelyan2002] ("PEFRL", equation 20); order 6:
/// [BlanesMoan2002], table 2 (S₁₀, order 6).
#pragma once

#include <array>
#include <cstddef>

namespace flexspline::batch::simulation {

template <std::size_t stages>
struct Composition {
  std::array<double, stages + 1> move{};
  std::array<double, stages> push{};
  double limit = 0;  ///< of ω h
};

constexpr Composition<4> fourth_order() noexcept {
  constexpr double xi = 0.1786178958448091;
  constexpr double lambda = -0.2123418310626054;
  constexpr double chi = -0.06626458266981849;
  return {
      {xi, chi, 1 - 2 * (chi + xi), chi, xi}, {0.5 - lambda, lambda, lambda, 0.5 - lambda}, 2.98};
}

constexpr Composition<10> sixth_order() noexcept {
  constexpr std::array<double, 5> a{0.0502627644003922, 0.413514300428344, 0.0450798897943977,
                                    -0.188054853819569, 0.541960678450780};
  constexpr std::array<double, 4> b{0.148816447901042, -0.132385865767784, 0.067307604692185,
                                    0.432666402578175};
  constexpr double middle = 1 - 2 * (a[0] + a[1] + a[2] + a[3] + a[4]);
  constexpr double last = 0.5 - (b[0] + b[1] + b[2] + b[3]);
  return {{a[0], a[1], a[2], a[3], a[4], middle, a[4], a[3], a[2], a[1], a[0]},
          {b[0], b[1], b[2], b[3], last, last, b[3], b[2], b[1], b[0]},
          3.13};
}

template <int order>
inline constexpr auto composition = [] {
  static_assert(order == 4 || order == 6);
  if constexpr (order == 4) {
    return fourth_order();
  } else {
    return sixth_order();
  }
}();

}  // namespace flexspline::batch::simulation
