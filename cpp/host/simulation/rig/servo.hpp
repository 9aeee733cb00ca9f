/// A servo law at its own rate: position loop over velocity loop, with limit and delay.
///
///   ω_ref = K_p (Ñ q_ref − θ_meas) + Ñ q̇_ref
///   τ     = K_v (ω_ref − ω_meas) + I + τ_ff,    I ← I + K_i (ω_ref − ω_meas) T,    |τ| ≤ τ_max
///
/// All at the motor side. Gains of zero give P, PI or PD loops: a plain PD on the angle is
/// K_p K_v and K_v. The integral stands while the limit would be passed further. With an encoder
/// step the angle is rounded down to it and the velocity is its difference over one period, as a
/// drive sees it. The torque holds until the next tick and comes `delay` ticks late.
#pragma once

#include <array>

#include "host/simulation/common/encoder.hpp"
#include "host/simulation/common/servo_limit.hpp"
#include "host/simulation/rig/joint.hpp"

namespace flexspline::batch::simulation {

inline constexpr std::size_t longest_delay = 64;  ///< ticks

struct Servo {
  double period = 0;         ///< s; 0: no servo
  double position_gain = 0;  ///< K_p, 1/s
  double velocity_gain = 0;  ///< K_v, Nm s/rad
  double integral_gain = 0;  ///< K_i, Nm/rad
  double limit = 0;          ///< Nm, > 0
  double encoder_step = 0;   ///< rad of the side it reads; 0: exact
  bool reads_output = false;
  std::size_t delay = 0;  ///< ticks, ≤ longest_delay

  struct State {
    double integral = 0;
    double last = 0;  ///< rad, encoder at the last tick
    bool started = false;
    std::size_t tick = 0;
    std::array<double, longest_delay + 1> line{};
  };
};

/// What a servo is told at one tick.
struct Command {
  double position = 0;  ///< rad at the output
  double velocity = 0;  ///< rad/s at the output
  double torque = 0;    ///< Nm at the motor, feed-forward
};

/// Torque from this tick on.
inline double servo_step(const Servo& servo, const Joint& joint, const Command& command,
                         const Motion& m, Servo::State& state) noexcept {
  const std::size_t side = servo.reads_output ? output : motor;
  const double scale = servo.reads_output ? joint.ratio : 1;
  const bool follows = joint.rigid && side == motor;  // a rigid gear's motor has no state
  double angle = follows ? rigid_motor_angle(joint, m.position[output]) : m.position[side];
  double speed = follows ? joint.ratio * m.velocity[output] : m.velocity[side];
  if (servo.encoder_step > 0) {
    angle = Encoder{servo.encoder_step}.below(angle);
    speed = state.started ? (angle - state.last) / servo.period : 0;
  }
  state.last = angle;
  state.started = true;
  const double wanted = servo.position_gain * (joint.ratio * command.position - scale * angle) +
                        joint.ratio * command.velocity;
  const double error = wanted - scale * speed;
  const double more = servo.integral_gain * error * servo.period;
  const double free = servo.velocity_gain * error + state.integral + command.torque;
  const double held = limited(free + more, more, servo.limit, state.integral);
  const std::size_t length = servo.delay + 1;
  state.line[state.tick % length] = held;
  ++state.tick;
  return state.tick > servo.delay ? state.line[state.tick % length] : 0;
}

}  // namespace flexspline::batch::simulation
