/// A position servo that ticks at the rows of a log.
///
///   u = clamp(K_p e + K_d ė + I, −u_max, u_max),    I ← I + K_i e T,    e = q_ref − q_meas
///   τ_m = k u (or k V u: the bridge switches the supply V) − k_e q̇
///
/// q_meas is the output's angle on the grid of its encoder, ė the difference of e over one tick;
/// the first tick has none. The integral stands while the limit would be passed further. u holds
/// until the next tick. The back-EMF k_e acts all the time, at the motor's shaft for each rad/s of
/// the output. While not enabled: no torque, no back-EMF, and the integral is empty.
#pragma once

#include "host/simulation/common/encoder.hpp"
#include "host/simulation/common/servo_limit.hpp"
#include "host/simulation/fitted/inputs.hpp"

namespace flexspline::batch::forward {

struct PositionServo {
  double position_gain = 0;  ///< u per rad
  double velocity_gain = 0;  ///< u per rad/s
  double integral_gain = 0;  ///< u per rad s
  double limit = 1;          ///< of |u|
  double torque = 1;         ///< k, Nm (or A) at the shaft for each u, or each V u
  double back_emf = 0;       ///< k_e, Nm (or A) at the shaft per rad/s of the output
  double encoder_step = 0;   ///< rad at the output; 0: exact

  struct State {
    double integral = 0;  ///< in units of u
    double error = 0;     ///< rad, of the last tick
    bool started = false;
  };

  /// The nearest count of the encoder.
  double measured(double position) const noexcept {
    return simulation::Encoder{encoder_step}.nearest(position);
  }

  /// u from this tick on; `period` [s] is that until the next.
  double step(double command, double position, double period, State& state) const noexcept {
    const double error = command - measured(position);
    const double rate = state.started ? (error - state.error) / period : 0;
    const double more = integral_gain * error * period;
    const double wanted = position_gain * error + velocity_gain * rate + state.integral + more;
    const double held = simulation::limited(wanted, more, limit, state.integral);
    state.error = error;
    state.started = true;
    return held;
  }

  /// What the motor gives from row i to the next one.
  void drive(const Signals& signals, std::size_t i, double position, State& state,
             Inputs& in) const noexcept {
    in.motor = {};
    in.damping = 0;
    if (signals.enabled != nullptr && signals.enabled[i] == 0) {
      state = {};
      return;
    }
    const double period = signals.time[i + 1] - signals.time[i];
    const double volts = signals.supply != nullptr ? signals.supply[i] : 1;
    in.motor.value = torque * volts * step(signals.command[i], position, period, state);
    in.damping = back_emf;
  }
};

}  // namespace flexspline::batch::forward
