/// Effects side by side, with their coefficients: what runs on the joint.
#pragma once

#include <tuple>
#include <utility>

#include "flexspline/effects/harmonics.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

template <typename Effect>
concept HarmonicEffect = requires(const Effect& effect) { effect.harmonics; };

/// Effects that make up the transmitted torque beside the known load.
template <typename Effect>
concept CarriesLoad = Effect::carries_load;

/// How many terms an effect's row has at most.
template <typename S, typename Effect>
inline constexpr std::size_t width_of =
    std::tuple_size_v<decltype(std::declval<Effect>().row(std::declval<Sample<S>>()))>;

template <typename Effect>
constexpr bool reads(Channel channel) noexcept {
  for (const Channel c : Effect::reads) {
    if (c == channel) return true;
  }
  return false;
}

/// row · coefficients, term by term from the left.
template <typename S, std::size_t N>
constexpr S weighted(const Row<S, N>& row, const std::array<S, N>& coefficients) noexcept {
  S sum = S(0);
  for (std::size_t k = 0; k < N; ++k) sum += row[k] * coefficients[k];
  return sum;
}

/// An effect and its coefficients.
template <typename S, typename Effect>
struct Part {
  Effect effect;
  std::array<S, width_of<S, Effect>> coefficients{};

  constexpr S torque(const Sample<S>& at) const noexcept {
    return weighted<S>(effect.row(at), coefficients);
  }
};

/// The sum of effects, evaluated in the order of the list.
///
///   τ = Σ row_i(sample) · coefficients_i
///
/// The load of the sample is the known load plus the model's own inertia and gravity; it is
/// filled before any row is read, so no row depends on coefficients.
template <typename S, typename... Effects>
struct Model {
  Gear<S> gear;
  std::tuple<Part<S, Effects>...> parts;

  static constexpr bool uses([[maybe_unused]] Channel channel) noexcept {
    return (reads<Effects>(channel) || ...);
  }

  /// Fills what follows from the measured channels: the motor's angle, the pairs, the load.
  constexpr void prepare(Sample<S>& at) const noexcept {
    if constexpr (uses(Channel::motor_position)) {
      const Phase<S> q = at.output_position.phase;
      if (!gear.motor_encoder) at.motor_position = {0, gear.motor_phase(at.output_position)};
      at.wave_generator_on_flexspline = gear.against_flexspline(q, at.motor_position.phase);
      at.wave_generator_on_circular_spline =
          gear.against_circular_spline(q, at.motor_position.phase);
    }
    if constexpr (uses(Channel::load)) {
      at.load = at.known_load + sum(at, [](const auto& part) {
                  return CarriesLoad<std::remove_cvref_t<decltype(part.effect)>>;
                });
    }
  }

  /// The modelled torque at one instant, in the target's unit. NaN or infinity in a channel
  /// that the model reads: `not_finite`, and `torque` keeps its last good value.
  constexpr Status predict(Sample<S> at, S& torque) const noexcept {
    if (!readable(at)) return Status::not_finite;
    prepare(at);
    const S total = sum(at, [](const auto&) { return true; });
    if (!math::is_finite(total)) return Status::not_finite;
    torque = total;
    return Status::ok;
  }

 private:
  template <typename Chosen>
  constexpr S sum(const Sample<S>& at, Chosen chosen) const noexcept {
    S total = S(0);
    std::apply(
        [&](const auto&... part) {
          ((chosen(part) ? void(total += part.torque(at)) : void()), ...);
        },
        parts);
    return total;
  }

  static constexpr bool readable(const Sample<S>& at) noexcept {
    bool good = true;
    if constexpr (uses(Channel::output_velocity)) good &= math::is_finite(at.output_velocity);
    if constexpr (uses(Channel::output_acceleration)) {
      good &= math::is_finite(at.output_acceleration);
    }
    if constexpr (uses(Channel::temperature)) good &= math::is_finite(at.temperature);
    if constexpr (uses(Channel::load)) good &= math::is_finite(at.known_load);
    return good;
  }
};

}  // namespace flexspline
