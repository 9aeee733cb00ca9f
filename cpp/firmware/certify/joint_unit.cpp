// The exported chain of estimators: raw readings to external torque and contact.
#include "joint.hpp"
#include "unit.hpp"

namespace {

using Joint = joint::Joint<unit::Scalar>;

constinit flexspline::Reading<unit::Scalar> in{};
constinit Joint::State state{};
constinit Joint::Chain::Output out{};

std::optional<flexspline::Angle<unit::Scalar>> angle(const certify::Row<unit::Scalar>& row,
                                                     unsigned which) noexcept {
  const std::uint32_t mark = certify::has_output_position << which;
  if ((row.marks & mark) == 0) return std::nullopt;
  return flexspline::Angle<unit::Scalar>{row.turns[which], {row.fractions[which]}};
}

}  // namespace

void unit::take(const certify::Row<Scalar>& row) noexcept {
  if ((row.marks & certify::fresh) != 0) state = {};
  in.period = row.period;
  in.output_position = angle(row, 0);
  in.motor_position = angle(row, 1);
  in.output_velocity = row.output_velocity;
  in.output_acceleration = row.output_acceleration;
  in.motor_torque = row.motor_torque;
  in.sensor_voltage = row.sensor_voltage;
  in.sensor_torque = row.sensor_torque;
  in.thermistor_voltage = row.thermistor_voltage;
  in.temperature = row.temperature;
  in.time = row.time;
}

void unit::give(certify::Result<Scalar>& result) noexcept {
  result.values = {out.temperature,       out.sensor_torque,       out.external_sensor,
                   out.external_observer, out.external_compliance, out.external_compliant_observer,
                   out.external_merged,   out.merge_weight};
  result.contact = out.contact ? 1 : 0;
  result.flags = static_cast<std::uint8_t>(out.flags);
  result.faults = static_cast<std::uint8_t>(out.faults);
  result.missed = static_cast<std::uint16_t>(out.missed);
}

// Flattened, so that the constants of joint.hpp fold into the code: stages that are not there, and
// choices that are made, cost nothing.
extern "C" [[gnu::flatten]] flexspline::Status flexspline_step() noexcept {
  return joint::joint<unit::Scalar>.step(state, in, out);
}
