// One joint at 1 kHz: readings in, external torque and contact out, once per control period.
//
// `joint.hpp` is what `flexspline export --format header` wrote. On a board, `read_inputs` reads
// your encoder and converters, and the loop is your timer's interrupt; here both are stand-ins, so
// that the file compiles and runs as it is. The joint has no velocity to read: its model has a
// differentiator. Give `in` what the comment at the top of your header asks for. The header of a
// model without estimators has no `Joint` to step: its comment shows `model<float>.predict` instead.
#include "joint.hpp"

namespace {

using Joint = joint::Joint<float>;

constexpr float period = 1e-3F;             // s
constexpr std::uint32_t counts_shift = 12;  // a 20-bit encoder: 2^20 counts are 2^32 fractions

/// What the drivers of a board deliver.
struct Inputs {
  std::int32_t output_turns, motor_turns;
  std::uint32_t output_counts, motor_counts;
  float sensor_voltage, thermistor_voltage, motor_torque;
};

Inputs read_inputs(std::uint32_t tick) noexcept {
  return {0, 0, tick, (tick * 101U) & 0xfffffU, 0.01F, 1.65F, 0.02F};
}

flexspline::Reading<float> reading(const Inputs& from) noexcept {
  flexspline::Reading<float> in;  // what is not read stays missing
  in.period = period;
  in.output_position = {from.output_turns, {from.output_counts << counts_shift}};
  in.motor_position = {from.motor_turns, {from.motor_counts << counts_shift}};
  in.sensor_voltage = from.sensor_voltage;
  in.thermistor_voltage = from.thermistor_voltage;
  in.motor_torque = from.motor_torque;
  return in;
}

constinit Joint::State state{};
constinit Joint::Chain::Output out{};

std::uint32_t suspicious = 0;  ///< readings; a device would say so to whoever maintains it

/// One period; whether the arm should stop. Flattened: the constants of joint.hpp fold into the
/// code.
[[gnu::flatten]] bool control(std::uint32_t tick) noexcept {
  const flexspline::Reading<float> in = reading(read_inputs(tick));
  const flexspline::Status status = joint::joint<float>.step(state, in, out);
  if (status != flexspline::Status::ok) return false;  // nothing has changed: wait for the next
  if (out.faults != flexspline::Fault::none) ++suspicious;  // a reading that cannot be true
  const bool watched = !has(out.missed, flexspline::Stage::collision);
  return watched && out.contact;
}

volatile std::uint32_t stops = 0;  // for a debugger to watch

}  // namespace

int main() {
  for (std::uint32_t tick = 1; tick <= 1000; ++tick) {
    if (control(tick)) stops = stops + 1;
  }
}
