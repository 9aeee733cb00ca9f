/// A log's channels as arrays, and short blocks of them as samples.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "flexspline/each_place.hpp"
#include "flexspline/effects/harmonics.hpp"
#include "flexspline/gear.hpp"
#include "host/wide_loop.hpp"

namespace flexspline::batch {

/// Borrowed columns of equal length; a null pointer is a channel that the log lacks.
struct Channels {
  std::size_t size = 0;
  const double* output_position = nullptr;  ///< rad
  const double* motor_position = nullptr;   ///< rad
  const double* known_load = nullptr;       ///< Nm
  /// In the order of `numbers`. The period is 0 where a run starts anew.
  std::array<const double*, numbers<double>.size()> number{};
};

/// The place of a channel in `numbers`; behind the last where it is none of them.
constexpr std::size_t place_of_number(Channel channel) noexcept {
  std::size_t place = 0;
  while (place < numbers<double>.size() && numbers<double>[place].channel != channel) ++place;
  return place;
}

/// Up to `capacity` samples of a log, a column each, so that a loop over them vectorises. Plain
/// channels stay where they are; phases are made here.
struct SampleBlock {
  enum class Angles { none, output, both_sides };

  static constexpr std::size_t capacity = 1024;
  template <typename T>
  struct alignas(64) Column : std::array<T, capacity> {};

  std::size_t size = 0;
  const double* output_position = nullptr;
  const double* motor_position = nullptr;
  const double* known_load = nullptr;
  const double* load = nullptr;
  std::array<const double*, numbers<double>.size()> number{};  ///< as in `Channels`
  Column<std::int32_t> turns;
  Column<std::uint64_t> output_phase, motor_phase, flexspline_phase, circular_spline_phase;

  /// Points at rows [first, first + count) and fills the phases asked for; the load is the known
  /// load.
  /// A channel that the log lacks is what `Sample` has (period: 1); a position that is not finite
  /// gives phase zero.
  void read(const Channels& from, std::size_t first, std::size_t count, const Gear<double>& gear,
            Angles angles) noexcept {
    static const auto lacking = lacking_numbers();
    static const Column<double> none{};
    const auto at = [first](const double* column, const Column<double>& absent) {
      return column != nullptr ? column + first : absent.data();
    };
    size = count;
    output_position = at(from.output_position, none);
    motor_position = at(from.motor_position, none);
    known_load = at(from.known_load, none);
    for (std::size_t k = 0; k < number.size(); ++k) number[k] = at(from.number[k], lacking[k]);
    load = known_load;
    if (angles == Angles::none) return;
    if (from.output_position == nullptr) {
      std::fill_n(turns.begin(), count, 0);
      std::fill_n(output_phase.begin(), count, 0);
    } else {
      read_angle(from.output_position + first, turns, output_phase);
    }
    if (angles == Angles::both_sides) read_motor(from, first, gear);
  }

  /// A channel that is one of `numbers`.
  template <Channel channel>
  const double* column() const noexcept {
    static_assert(place_of_number(channel) < numbers<double>.size());
    return number[place_of_number(channel)];
  }

  /// The phases of one pair of parts.
  const std::uint64_t* phases(Pair pair) const noexcept {
    switch (pair) {
      case Pair::output_on_housing:
        return output_phase.data();
      case Pair::motor_on_stator:
        return motor_phase.data();
      case Pair::wave_generator_on_flexspline:
        return flexspline_phase.data();
      case Pair::wave_generator_on_circular_spline:
        return circular_spline_phase.data();
    }
    return output_phase.data();
  }

  /// Whether a channel of sample i can be read; angles lose a NaN on their way to a phase.
  bool finite(Channel channel, std::size_t i) const noexcept {
    switch (channel) {
      case Channel::output_position:
        return math::is_finite(output_position[i]);
      case Channel::motor_position:
        return math::is_finite(output_position[i]) && math::is_finite(motor_position[i]);
      case Channel::load:
        return math::is_finite(load[i]);
      default:
        return math::is_finite(number[place_of_number(channel)][i]);
    }
  }

  Sample<double> operator[](std::size_t i) const noexcept {
    Sample<double> at;
    at.output_position = {turns[i], {output_phase[i]}};
    at.motor_position = {0, {motor_phase[i]}};
    at.known_load = known_load[i];
    for_each_place<numbers<double>.size()>(
        [&](std::size_t k) { at.*numbers<double>[k].at = number[k][i]; });
    at.wave_generator_on_flexspline = {flexspline_phase[i]};
    at.wave_generator_on_circular_spline = {circular_spline_phase[i]};
    at.load = load[i];
    return at;
  }

 private:
  static std::array<Column<double>, numbers<double>.size()> lacking_numbers() noexcept {
    Sample<double> lacking;
    lacking.period = 1;
    std::array<Column<double>, numbers<double>.size()> all;
    for (std::size_t k = 0; k < all.size(); ++k) all[k].fill(lacking.*numbers<double>[k].at);
    return all;
  }

  void read_angle(const double* angle, Column<std::int32_t>& whole,
                  Column<std::uint64_t>& phase) noexcept {
    run_wide([angle, count = size, w = whole.data(), p = phase.data()] {
      for (std::size_t i = 0; i < count; ++i) {
        const auto read = Angle<double>::from_radians(angle[i]);
        w[i] = read.turns;
        p[i] = read.phase.fraction;
      }
    });
  }

  void read_motor(const Channels& from, std::size_t first, const Gear<double>& gear) noexcept {
    if (gear.motor_encoder && from.motor_position == nullptr) {
      std::fill_n(motor_phase.begin(), size, 0);
    } else if (gear.motor_encoder) {
      Column<std::int32_t> whole;
      read_angle(from.motor_position + first, whole, motor_phase);
    }
    run_wide([this, &gear] {
      for (std::size_t i = 0; i < size; ++i) {
        const Phase<double> q{output_phase[i]};
        const Phase<double> theta =
            gear.motor_encoder ? Phase<double>{motor_phase[i]} : gear.motor_phase({turns[i], q});
        motor_phase[i] = theta.fraction;
        flexspline_phase[i] = gear.against_flexspline(q, theta).fraction;
        circular_spline_phase[i] = gear.against_circular_spline(q, theta).fraction;
      }
    });
  }
};

/// Whether angles [rad] are such that the kernel takes them as they are, without phases.
inline bool within_reach(const double* angle, std::size_t count) {
  double farthest = 0.0;
  run_wide([angle, count, &farthest] {
    double most = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double size = math::absolute(angle[i]);
      most = size < most ? most : size;
    }
    farthest = most;
  });
  return farthest <= 1e6;  // false for NaN too
}

}  // namespace flexspline::batch
