#pragma once

#include "flexspline/effects/effect.hpp"
#include "flexspline/gear_compliance.hpp"

namespace flexspline {

/// Torsion of the wave generator under the motor's torque: soft at first, then at its stop, which
/// shows as lost motion.
///
///   Δθ = −c · sgn(τ_m) (1 − e^(−c_w |τ_m|)) / c_w,     c = 1 / K_w0
///
/// At τ_m = 0: 0, with slope −c. Far above 1/c_w: ∓c / c_w. Odd in τ_m. Linear in c. A motor that
/// pushes against a held output runs ahead, so Δθ = q Ñ − θ is negative; (16) as printed is not.
/// Source: full_range_torque_estimation (14), (16).
template <typename S>
struct WaveGeneratorCompliance {
  static constexpr std::string_view name = "wave_generator_compliance";
  static constexpr std::string_view targets = "D";
  static constexpr std::string_view signature =
      "the torsion jumps where the motor's torque changes sign";
  static constexpr std::string_view source = "full_range_torque_estimation (14), (16)";
  static constexpr std::array<Term, 1> terms{{{"compliance", "rad/Nm"}}};
  static constexpr std::array<Channel, 1> reads{Channel::motor_torque};
  static constexpr Traits traits{.one_signed = true};
  static constexpr std::array<Demand, 1> demands{{{Excitation::motor_torque}}};

  S wave_generator_shape = S(3);  ///< c_w, 1/Nm at the motor, > 0

  static constexpr auto shapes() noexcept {
    return std::array{Shape<WaveGeneratorCompliance, S>{
        "wave_generator_shape", "1/Nm", &WaveGeneratorCompliance::wave_generator_shape, S(0.01),
        S(1000), true}};
  }

  constexpr Row<S, 1> row(const Sample<S>& at) const noexcept {
    return {wave_generator_torsion(at.motor_torque, S(1), wave_generator_shape)};
  }
};

}  // namespace flexspline
