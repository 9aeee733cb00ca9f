// One joint at 1 kHz: readings in, external torque and contact out, once per control period.
//
// `joint.hpp` is what `flexspline export --format header` wrote. On a board, `read_inputs` reads
// your encoder and converters, and the loop is your timer's interrupt; here both are stand-ins, so
// that the file compiles and runs as it is.
#include "flexspline/reading_checks.hpp"
#include "joint.hpp"

namespace {

using Joint = joint::Joint<float>;
using Checks = flexspline::ReadingChecks<float>;

constexpr float period = 1e-3F;             // s
constexpr std::uint32_t counts_shift = 12;  // a 20-bit encoder: 2^20 counts are 2^32 fractions

/// What this joint cannot have: put in your own.
constexpr Checks::Config limits{.least_voltage = -1.6F,
                                .most_voltage = 1.6F,
                                .most_motor_torque = 2.0F,
                                .most_speed = 8.0F,
                                .most_acceleration = 200.0F,
                                .way = 0.01F,
                                .twist = 0.5F,
                                .gear = joint::joint<float>.torsion.gear};

/// What the drivers of a board deliver.
struct Inputs {
  std::int32_t output_turns, motor_turns;
  std::uint32_t output_counts, motor_counts;
  float sensor_voltage, thermistor_voltage, output_velocity, motor_torque;
};

Inputs read_inputs(std::uint32_t tick) noexcept {
  return {0, 0, tick, (tick * 101U) & 0xfffffU, 0.01F, 1.65F, 0.006F, 0.02F};
}

flexspline::Reading<float> reading(const Inputs& from) noexcept {
  flexspline::Reading<float> in;  // what is not read stays missing
  in.period = period;
  in.output_position = {from.output_turns, {from.output_counts << counts_shift}};
  in.motor_position = {from.motor_turns, {from.motor_counts << counts_shift}};
  in.sensor_voltage = from.sensor_voltage;
  in.thermistor_voltage = from.thermistor_voltage;
  in.output_velocity = from.output_velocity;
  in.output_acceleration = 0.0F;
  in.motor_torque = from.motor_torque;
  return in;
}

constinit Checks::State seen{};
constinit Joint::State state{};
constinit Joint::Chain::Output out{};

/// One period; whether the arm should stop. Flattened: the constants of joint.hpp fold into the
/// code.
[[gnu::flatten]] bool control(std::uint32_t tick) noexcept {
  flexspline::Reading<float> in = reading(read_inputs(tick));
  (void)Checks::step(limits, seen, in);  // what cannot be true is missing from here on
  const flexspline::Status status = joint::joint<float>.step(state, in, out);
  if (status != flexspline::Status::ok) return false;  // nothing has changed: wait for the next
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
