// A device in a pipe: readings in, estimates out, one at a time, through an exported header.
//
//   chain float|double < rows > results
//
// A row is eleven doubles: 1 for a fresh start, period, output angle, motor angle (radians, which
// become an encoder's counts of 2^-32 turns in float), velocity, acceleration, motor torque, sensor
// voltage, sensor torque, thermistor voltage, temperature; NaN is missing. A result is twelve:
// temperature, sensor torque, external torques of sensor, observer, compliance and merged, contact,
// flags, missed stages, status, external torque of the compliant observer, what was taken out.
#include <array>
#include <cstdio>
#include <cstring>

#include "joint.hpp"

namespace {

template <typename S>
std::optional<flexspline::Angle<S>> read_angle(double radians) noexcept {
  if (!flexspline::math::is_finite(radians)) return std::nullopt;
  const auto fine = flexspline::Angle<double>::from_radians(radians);
  constexpr int spare = 64 - 8 * int(sizeof(S));
  const auto fraction = static_cast<flexspline::math::Bits<S>>(fine.phase.fraction >> spare);
  return flexspline::Angle<S>{fine.turns, {fraction}};
}

template <typename S>
flexspline::Reading<S> reading(const std::array<double, 11>& row) noexcept {
  flexspline::Reading<S> in;
  in.period = static_cast<S>(row[1]);
  in.output_position = read_angle<S>(row[2]);
  in.motor_position = read_angle<S>(row[3]);
  in.output_velocity = static_cast<S>(row[4]);
  in.output_acceleration = static_cast<S>(row[5]);
  in.motor_torque = static_cast<S>(row[6]);
  in.sensor_voltage = static_cast<S>(row[7]);
  in.sensor_torque = static_cast<S>(row[8]);
  in.thermistor_voltage = static_cast<S>(row[9]);
  in.temperature = static_cast<S>(row[10]);
  return in;
}

template <typename S>
int stream() noexcept {
  using Joint = joint::Joint<S>;
  typename Joint::State state;
  typename Joint::Chain::Output out;
  std::array<double, 11> row{};
  while (std::fread(row.data(), sizeof row, 1, stdin) == 1) {
    if (row[0] == 1.0) state = {};
    const flexspline::Status status = joint::joint<S>.step(state, reading<S>(row), out);
    const auto wide = [](auto value) { return static_cast<double>(value); };
    const std::array<double, 12> result{wide(out.temperature),
                                        wide(out.sensor_torque),
                                        wide(out.external_sensor),
                                        wide(out.external_observer),
                                        wide(out.external_compliance),
                                        wide(out.external_merged),
                                        wide(out.contact),
                                        wide(out.flags),
                                        wide(out.missed),
                                        wide(status),
                                        wide(out.external_compliant_observer),
                                        wide(out.faults)};
    if (std::fwrite(result.data(), sizeof result, 1, stdout) != 1) return 1;
  }
  return 0;
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) return 2;
  const bool single = std::strcmp(arguments[1], "float") == 0;
  return single ? stream<float>() : stream<double>();
}
