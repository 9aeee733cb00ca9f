/// Effects side by side, with their coefficients: what runs on the joint.
#pragma once

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "flexspline/effects/harmonics.hpp"
#include "flexspline/gear.hpp"
#include "flexspline/reading_limits.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

/// An effect and its coefficients.
template <typename S, typename Effect>
struct Part {
  Effect effect;
  std::array<S, width_of<S, Effect>> coefficients{};

  constexpr S torque(const Sample<S>& at) const noexcept
    requires(!Remembers<Effect>)
  {
    return weighted<S>(effect.row(at), coefficients);
  }
  constexpr S torque(const Sample<S>& at, StateOf<Effect>& state) const noexcept {
    return weighted<S>(row_of(effect, at, state), coefficients);
  }
};

/// The memory of effect number I; nothing where it has none.
template <std::size_t I, typename T>
struct Slot {
  T state{};
};
template <std::size_t I>
struct Slot<I, NoState> {};

template <typename Numbers, typename... T>
struct Slots;
template <std::size_t... I, typename... T>
struct Slots<std::index_sequence<I...>, T...> : Slot<I, T>... {};

/// The memory of a model: a plain struct, empty where no effect has any. `States{}` has seen
/// nothing; a copy saves it, assigning the copy restores it.
template <typename... Effects>
using States = Slots<std::index_sequence_for<Effects...>, StateOf<Effects>...>;

/// The memory of effect number I, which has one.
template <std::size_t I, typename T>
constexpr T& state_of(Slot<I, T>& slot) noexcept {
  return slot.state;
}

/// What a model does with a sample, whatever holds its effects: `Model`, whose effects are types, or
/// one that is put together at run time (`AnyModel` on a PC). It has
///
///   gear             relates the angles of the sample
///   reads<channel>() whether any effect reads it
///   remembers        whether any effect has a memory, `State`
///   carried(at)      what its own effects add to the known load
///   follows_load, by_load(at)
///                    whether any effect without memory reads the load; the sum of these alone, in
///                    a sample that is prepared
///   sum(at, state)   Σ row_i(sample) · coefficients_i, in the order of the list
///   first_row<N>(at), first_coefficients<N>()
///                    N numbers from the first effect on; 0 behind the last, and in the rows of
///                    effects with a memory
namespace evaluation {

/// Fills what follows from the measured channels: the motor's angle, the pairs, the load.
template <typename S, typename Model>
constexpr void prepare(const Model& model, Sample<S>& at) noexcept {
  if (model.template reads<Channel::motor_position>()) {
    const Phase<S> q = at.output_position.phase;
    if (!model.gear.motor_encoder) {
      at.motor_position = {0, model.gear.motor_phase(at.output_position)};
    }
    at.wave_generator_on_flexspline = model.gear.against_flexspline(q, at.motor_position.phase);
    at.wave_generator_on_circular_spline =
        model.gear.against_circular_spline(q, at.motor_position.phase);
  }
  if (model.template reads<Channel::load>()) at.load = at.known_load + model.carried(at);
}

/// Whether a channel is finite, or the model does not read it.
template <Channel channel, typename S, typename Model>
constexpr bool readable(const Model& model, S value) noexcept {
  return channel == Channel::period || !model.template reads<channel>() || math::is_finite(value);
}

/// Whether all numbers that the model reads are finite; the period is looked at by itself.
template <typename S, typename Model, std::size_t... k>
constexpr bool readable(const Model& model, const Sample<S>& at,
                        std::index_sequence<k...>) noexcept {
  bool good = true;
  ((good &= readable<numbers<S>[k].channel>(model, at.*numbers<S>[k].at)), ...);
  return good & readable<Channel::load>(model, at.known_load);
}

/// The modelled torque at one instant, in the target's unit; `state` moves with each good sample.
/// NaN or infinity in a channel that the model reads: `not_finite`; with effects that read it, a
/// period that is not above zero or above the longest: `bad_period`. `torque` and `state` keep their
/// last good value.
template <typename S, typename Model>
constexpr Status predict(const Model& model, Sample<S> at, typename Model::State& state,
                         S& torque) noexcept {
  if (!readable(model, at, NumberPlaces{})) return Status::not_finite;
  if (model.template reads<Channel::period>() && !is_period(at.period)) {
    return Status::bad_period;
  }
  prepare(model, at);
  typename Model::State next = state;
  const S total = model.sum(at, next);
  if (!math::is_finite(total)) return Status::not_finite;
  state = next;
  torque = total;
  return Status::ok;
}

/// The torque of a sample whose channels are finite or NaN, NaN where the model cannot say; its
/// period is good. Without memory nothing is looked at: what is NaN runs through.
template <typename S, typename Model>
constexpr S torque(const Model& model, Sample<S> at, typename Model::State& state) noexcept {
  if (model.remembers) {
    S found = std::numeric_limits<S>::quiet_NaN();
    (void)predict(model, at, state, found);
    return found;
  }
  prepare(model, at);
  return model.sum(at, state);
}

}  // namespace evaluation

/// Whether effects read a channel that has a limit.
template <typename... Effects>
constexpr bool has_limit(Channel channel) noexcept {
  constexpr ReadingLimits<float> known;
  return known.of(channel) < known.none && (reads<Effects>(channel) || ...);
}

/// The channels, in their order, that effects read and that have a limit.
template <typename... Effects>
constexpr auto limited_channels() noexcept {
  constexpr auto count = [] {
    std::size_t found = 0;
    for (std::size_t k = 0; k < channel_names.size(); ++k) {
      found += has_limit<Effects...>(static_cast<Channel>(k)) ? 1 : 0;
    }
    return found;
  }();
  std::array<Channel, count> made{};
  for (std::size_t k = 0, next = 0; k < channel_names.size(); ++k) {
    if (has_limit<Effects...>(static_cast<Channel>(k))) made[next++] = static_cast<Channel>(k);
  }
  return made;
}

/// The largest, either way, that a model takes of each number that its effects read.
template <typename S, typename... Effects>
struct ModelLimits {
  static constexpr auto channels = limited_channels<Effects...>();

  std::array<S, channels.size()> most = widest();  ///< of each of these

  /// Whether a value of a channel is not beyond its limit; NaN is beyond none.
  template <Channel channel>
  constexpr bool has(S value) const noexcept {
    constexpr std::size_t place =
        std::size_t(std::find(channels.begin(), channels.end(), channel) - channels.begin());
    if constexpr (place < channels.size()) return !(math::absolute(value) > most[place]);
    return true;
  }

 private:
  static constexpr std::array<S, channels.size()> widest() noexcept {
    constexpr ReadingLimits<S> known;
    std::array<S, channels.size()> made{};
    for (std::size_t k = 0; k < made.size(); ++k) made[k] = known.of(channels[k]);
    return made;
  }
};

/// The sum of effects, evaluated in the order of the list.
///
///   τ = Σ row_i(sample) · coefficients_i
///
/// The load of the sample is the known load plus the model's own inertia and gravity; it is
/// filled before any row is read, so no row depends on coefficients.
///
/// Where an effect remembers, the caller keeps a `State` and hands it to each step; it begins anew
/// with `State{}`, as it must after a gap.
///
/// A sample with a channel beyond its limit (reading_limits.hpp) is `out_of_range`. The models of a
/// `Joint` are not asked: it looks at its readings before they are.
template <typename S, typename... Effects>
struct Model {
  using State = States<Effects...>;
  static constexpr bool remembers = (Remembers<Effects> || ...);
  template <typename Effect>
  static constexpr bool follows = !Remembers<Effect> && flexspline::reads<Effect>(Channel::load);
  static constexpr bool follows_load = (follows<Effects> || ...);
  static_assert((PhysicalEffect<Effects, S> && ...));

  Gear<S> gear;
  std::tuple<Part<S, Effects>...> parts;
  [[no_unique_address]] ModelLimits<S, Effects...> limits{};

  static constexpr bool uses([[maybe_unused]] Channel channel) noexcept {
    return (flexspline::reads<Effects>(channel) || ...);
  }
  /// The same as a type, so that what is not read costs nothing.
  template <Channel channel>
  static constexpr std::bool_constant<uses(channel)> reads() noexcept {
    return {};
  }

  /// See `evaluation::prepare`.
  constexpr void prepare(Sample<S>& at) const noexcept { evaluation::prepare(*this, at); }

  /// See `evaluation::predict`.
  constexpr Status predict(const Sample<S>& at, S& torque) const noexcept
    requires(!remembers)
  {
    State none;
    return predict(at, none, torque);
  }
  constexpr Status predict(const Sample<S>& at, State& state, S& torque) const noexcept {
    if (!in_range(at, NumberPlaces{})) [[unlikely]] {
      const bool finite = evaluation::readable(*this, at, NumberPlaces{});
      return finite ? Status::out_of_range : Status::not_finite;
    }
    return evaluation::predict(*this, at, state, torque);
  }

  /// See `evaluation::torque`.
  constexpr S torque(const Sample<S>& at, State& state) const noexcept {
    return evaluation::torque(*this, at, state);
  }

  /// The torque of a sample that is prepared.
  constexpr S sum(const Sample<S>& at, State& state) const noexcept {
    return sum_of(at, state, std::index_sequence_for<Effects...>{});
  }

  /// The first numbers of the rows in a sample that is prepared.
  template <std::size_t N>
  constexpr Row<S, N> first_row(const Sample<S>& at) const noexcept {
    Row<S, N> made{};
    fill_first(made, [&at]<typename Effect>(const Part<S, Effect>& part) {
      if constexpr (Remembers<Effect>) {
        return Row<S, width_of<S, Effect>>{};
      } else {
        return part.effect.row(at);
      }
    });
    return made;
  }

  template <std::size_t N>
  constexpr std::array<S, N> first_coefficients() const noexcept {
    std::array<S, N> made{};
    fill_first(made, [](const auto& part) { return part.coefficients; });
    return made;
  }

  /// Replaces the first coefficients.
  template <std::size_t N>
  constexpr void take_first(const std::array<S, N>& values) noexcept {
    std::size_t first = 0;
    const auto take = [&](auto& coefficients) {
      for (std::size_t k = 0; k < coefficients.size() && first + k < N; ++k) {
        coefficients[k] = values[first + k];
      }
      first += coefficients.size();
    };
    std::apply([&](auto&... part) { (take(part.coefficients), ...); }, parts);
  }

  constexpr S by_load(const Sample<S>& at) const noexcept {
    S total = S(0);
    const auto add = [&]<typename Effect>(const Part<S, Effect>& part) {
      if constexpr (follows<Effect>) total += part.torque(at);
    };
    std::apply([&](const auto&... part) { (add(part), ...); }, parts);
    return total;
  }

  /// What the model's own effects add to the known load.
  constexpr S carried(const Sample<S>& at) const noexcept {
    S total = S(0);
    const auto add = [&]<typename Effect>(const Part<S, Effect>& part) {
      if constexpr (CarriesLoad<Effect>) total += part.torque(at);
    };
    std::apply([&](const auto&... part) { (add(part), ...); }, parts);
    return total;
  }

 private:
  /// Numbers of the parts one behind the other, as many as there is room for.
  template <std::size_t N, typename Of>
  constexpr void fill_first(std::array<S, N>& made, const Of& of) const noexcept {
    std::size_t first = 0;
    const auto put = [&](const auto& part) {
      if (first < N) {
        const auto its = of(part);
        for (std::size_t k = 0; k < its.size() && first + k < N; ++k) made[first + k] = its[k];
      }
      first += part.coefficients.size();
    };
    std::apply([&](const auto&... part) { (put(part), ...); }, parts);
  }

  template <std::size_t... k>
  constexpr bool in_range(const Sample<S>& at, std::index_sequence<k...>) const noexcept {
    bool good = limits.template has<Channel::load>(at.known_load);
    ((good &= limits.template has<numbers<S>[k].channel>(at.*numbers<S>[k].at)), ...);
    if constexpr (uses(Channel::output_position) || uses(Channel::motor_position)) {
      good &= at.output_position.in_range();
    }
    if constexpr (uses(Channel::motor_position)) {
      good &= !gear.motor_encoder || at.motor_position.in_range();
    }
    return good;
  }

  template <std::size_t I>
  constexpr S torque_of(const Sample<S>& at, [[maybe_unused]] State& state) const noexcept {
    const auto& part = std::get<I>(parts);
    if constexpr (Remembers<std::tuple_element_t<I, std::tuple<Effects...>>>) {
      return part.torque(at, state_of<I>(state));
    } else {
      return part.torque(at);
    }
  }

  template <std::size_t... I>
  constexpr S sum_of([[maybe_unused]] const Sample<S>& at, [[maybe_unused]] State& state,
                     std::index_sequence<I...>) const noexcept {
    S total = -S(0);  // −0 + x is x, bit by bit
    ((total += torque_of<I>(at, state)), ...);
    return total;
  }
};

}  // namespace flexspline
