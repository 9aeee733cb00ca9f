/// What must hold in each step of a joint, whatever bits its readings have.
///
///   the verdict is `ok` exactly where the period is good; else neither state nor output changes
///   every output is finite, and that of a stage that missed is the one before
///   a state that was copied before the step gives the same outputs again
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <span>

#include "flexspline/joint.hpp"

namespace flexspline::fuzz {

/// Says which law of the core is broken, and ends the program.
inline void require(bool holds, const char* law) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", law);
  std::abort();
}

/// Takes values from the fuzzer's bytes; zeros behind their end.
class Source {
 public:
  explicit Source(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  bool empty() const { return bytes_.empty(); }
  std::span<const std::uint8_t> rest() const { return bytes_; }
  void skip(std::size_t count) { bytes_ = bytes_.subspan(count); }

  template <typename T>
  T take() {
    T value{};
    const std::size_t size = sizeof value < bytes_.size() ? sizeof value : bytes_.size();
    if (size > 0) std::memcpy(&value, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
    return value;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// Step k of a calm run: everything is there and plausible.
template <typename S>
Reading<S> calm_reading(int k) {
  const S turns = S(0.6 * 0.001 / 6.283185307179586) * S(k % 9000);  // the angle of its velocity
  Reading<S> in;
  in.period = S(0.001);
  in.output_position = Angle<S>::from_turns(turns);
  in.motor_position = Angle<S>::from_turns(S(101) * turns);
  in.output_velocity = S(0.6);
  in.output_acceleration = S(0.1);
  in.motor_torque = S(0.02);
  in.sensor_voltage = S(0.01);
  in.sensor_torque = S(2);
  in.thermistor_voltage = S(1.6);
  in.temperature = S(30);
  in.time = S(0.001) * S(k);
  return in;
}

template <typename S>
Angle<S> any_angle(Source& source) {
  return {source.take<std::int32_t>(), {source.take<math::Bits<S>>()}};
}

/// A calm reading of which the next bytes replace what their first two say.
template <typename S>
Reading<S> any_reading(Source& source, int k) {
  Reading<S> in = calm_reading<S>(k);
  const auto which = source.take<std::uint16_t>();
  int bit = 0;
  for (S* field :
       {&in.period, &in.output_velocity, &in.output_acceleration, &in.motor_torque,
        &in.sensor_voltage, &in.sensor_torque, &in.thermistor_voltage, &in.temperature, &in.time}) {
    if ((which >> bit++ & 1) != 0) *field = source.take<S>();
  }
  for (auto* angle : {&in.output_position, &in.motor_position}) {
    if ((which >> bit++ & 1) != 0) *angle = any_angle<S>(source);
    if ((which >> bit++ & 1) != 0) *angle = std::nullopt;
  }
  return in;
}

template <typename S>
bool good_period(S period) {
  return period > S(0) && period <= Chain<S>::longest_period;  // NaN is none
}

template <typename S>
bool all_finite(const typename Chain<S>::Output& out) {
  bool finite = true;
  for (const S value : {out.temperature, out.sensor_torque, out.external_sensor,
                        out.external_observer, out.external_compliance,
                        out.external_compliant_observer, out.external_merged, out.merge_weight}) {
    finite = finite && math::is_finite(value);
  }
  return finite;
}

template <typename S>
void require_last_good(const typename Chain<S>::Output& out,
                       const typename Chain<S>::Output& before) {
  const auto kept = [&](Stage stage, auto field) {
    require(!has(out.missed, stage) || out.*field == before.*field, "a miss keeps the last good");
  };
  using Output = typename Chain<S>::Output;
  kept(Stage::sensor, &Output::external_sensor);
  kept(Stage::observer, &Output::external_observer);
  kept(Stage::compliance, &Output::external_compliance);
  kept(Stage::compliant_observer, &Output::external_compliant_observer);
  kept(Stage::merge, &Output::external_merged);
  kept(Stage::collision, &Output::contact);
}

template <typename T>
bool same_bytes(const T& a, const T& b) {
  return std::memcmp(static_cast<const void*>(&a), static_cast<const void*>(&b), sizeof a) == 0;
}

template <typename T>
void copy_bytes(T& to, const T& from) {
  std::memcpy(static_cast<void*>(&to), static_cast<const void*>(&from), sizeof to);
}

template <typename S, typename Joint>
void checked_step(const Joint& joint, typename Joint::State& state, const Reading<S>& in,
                  typename Joint::Chain::Output& out) {
  typename Joint::State before;
  typename Joint::Chain::Output last, again;
  copy_bytes(before, state);
  copy_bytes(last, out);
  copy_bytes(again, out);
  const Status status = joint.step(state, in, out);
  require((status == Status::ok) == good_period(in.period), "the verdict is the period's");
  require(all_finite<S>(out), "every output is finite");
  if (status != Status::ok) {
    require(same_bytes(state, before) && same_bytes(out, last), "a bad period changes nothing");
    return;
  }
  require_last_good<S>(out, last);
  typename Joint::State restored = before;
  require(joint.step(restored, in, again) == Status::ok && same_bytes(out, again),
          "a copied state goes on alike");
}

/// Steps through all readings that the bytes hold.
template <typename S, typename Joint>
void checked_run(const Joint& joint, typename Joint::State& state,
                 typename Joint::Chain::Output& out, Source& source) {
  for (int k = 0; !source.empty(); ++k)
    checked_step<S>(joint, state, any_reading<S>(source, k), out);
}

}  // namespace flexspline::fuzz
