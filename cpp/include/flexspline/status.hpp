/// Verdicts of a step, and remarks beside a good result.
#pragma once

#include <cstdint>
#include <limits>

namespace flexspline {

/// What a step found. Anything but `ok` leaves the outputs and the state as they were.
enum class [[nodiscard]] Status : std::uint8_t {
  ok = 0,
  not_finite = 1,    ///< NaN or infinity in a channel that the step reads, or in its result
  bad_period = 2,    ///< time since the last sample is zero, negative, absurd or not finite
  out_of_range = 3,  ///< a channel or a setting outside of what the formula is made for
};

/// What is to be known of a result that is good enough to use: bits, side by side.
enum class Flag : std::uint8_t {
  none = 0,
  extrapolated = 1,  ///< an input outside the range that the parameters were fitted in
  saturated = 2,     ///< held at the edge of the model, where its formula has a pole
  out_of_range = 4,  ///< a reading beyond its limit counts as missing (reading_limits.hpp)
};

constexpr Flag operator|(Flag a, Flag b) noexcept {
  return static_cast<Flag>(static_cast<std::uint8_t>(a) | static_cast<std::uint8_t>(b));
}
constexpr Flag operator&(Flag a, Flag b) noexcept {
  return static_cast<Flag>(static_cast<std::uint8_t>(a) & static_cast<std::uint8_t>(b));
}
/// Whether `flags` has any of the bits of `wanted`.
constexpr bool has(Flag flags, Flag wanted) noexcept { return (flags & wanted) != Flag::none; }

/// `extrapolated` outside of [low, high].
template <typename S>
constexpr Flag extrapolated(S value, S low, S high) noexcept {
  constexpr S most = std::numeric_limits<S>::max();
  const bool below = low > -most && value < low;  // no bound costs nothing where it is a constant
  const bool above = high < most && value > high;
  if (below || above) [[unlikely]]
    return Flag::extrapolated;
  return Flag::none;
}

/// What cannot be true of a reading (reading_limits.hpp, reading_checks.hpp), as bits.
enum class Fault : std::uint8_t {
  none = 0,
  sensor = 1,       ///< voltage or torque of the sensor out of range
  motor = 2,        ///< motor torque out of range
  speed = 4,        ///< velocity or acceleration out of range, or an angle that goes faster
  motion = 8,       ///< angle and velocity disagree
  encoders = 16,    ///< both angles disagree
  torques = 32,     ///< torques of sensor and observer disagree
  temperature = 64  ///< voltage of the thermistor or temperature out of range
};

constexpr Fault operator|(Fault a, Fault b) noexcept {
  return static_cast<Fault>(static_cast<std::uint8_t>(a) | static_cast<std::uint8_t>(b));
}
/// Whether `faults` has the bit of `wanted`.
constexpr bool has(Fault faults, Fault wanted) noexcept {
  return (static_cast<std::uint8_t>(faults) & static_cast<std::uint8_t>(wanted)) != 0;
}

/// A torque and what is to be known of it.
template <typename S>
struct FlaggedTorque {
  S torque = 0;  ///< Nm
  Flag flags = Flag::none;
};

}  // namespace flexspline
