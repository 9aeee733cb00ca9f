/// A joint driven through time: rows, servo ticks, stops, steps.
///
/// Between two rows inputs are linear (or hold the first one's value); each stretch without a jump
/// is cut into equal steps, as few as keep each at or below `longest_step`. Mechanics is of fourth
/// order in the step, or of sixth where nothing can stick, slip, touch or brake; temperatures
/// follow once a stretch. Asked for an accuracy, a smooth joint with losses takes series steps
/// instead, over many rows where its torques are straight lines and nothing else changes at rows.
/// What goes wrong is a `Fault` with its row; rows before it are valid.
#pragma once

#include <cmath>

#include "host/simulation/rig/series_steps.hpp"
#include "host/simulation/rig/servo.hpp"
#include "host/simulation/rig/signals.hpp"
#include "host/simulation/rig/thermal.hpp"

namespace flexspline::batch::simulation {

enum class Reaction : std::uint8_t { release, brake, hold_position };

/// When and how the motor stops.
struct Stop {
  double time = 1e300;       ///< s
  double threshold = 1e300;  ///< Nm of the torque through the sensor, seen at rows
  double delay = 0;          ///< s from the row that passes the threshold
  Reaction reaction = Reaction::release;
};

struct Options {
  double longest_step = 1e-4;       ///< s
  double coarsest = 1e300;          ///< of ω h of the gear; `unstable` beyond it
  int order = 4;                    ///< 4 or 6; the latter of joints without events
  double accuracy = 0;              ///< of series steps, of a joint that is expandable; 0: steps
  double shortest_series_step = 0;  ///< s; a motion that asks for less has no bound
  Servo servo;
  Stop stop;
};

/// Everything that goes on from one call to the next.
struct SimulationState {
  Motion motion;
  Servo::State servo;
  double next_tick = -1e300;  ///< s
  double servo_torque = 0;    ///< Nm, of the last tick
  double stop_time = 1e300;   ///< s
  bool stopped = false;
  Command held;  ///< after a stop that holds the position
};

struct Outcome {
  Fault fault = Fault::none;
  std::size_t row = 0;
  double largest_phase = 0;        ///< ω h
  double longest_series_step = 0;  ///< s
};

/// 1/s: the fastest eigenfrequency where the spring has dτ/du = `stiffness`, and the
/// fastest decay by friction and damping.
struct Fastest {
  double frequency = 0;
  double decay = 0;
};
inline Fastest fastest(const Joint& joint, double stiffness) noexcept {
  const double n2 = joint.ratio * joint.ratio;
  const double total = joint.output_inertia + n2 * joint.motor_inertia;
  const double by_output = 1 / (joint.rigid ? total : joint.output_inertia);
  const double by_motor = joint.rigid ? n2 / total : 1 / joint.motor_inertia;
  double squares = (joint.gravity + joint.obstacle.stiffness) * by_output;
  double decay = 0;
  if (!joint.rigid) {
    squares += (by_motor + n2 * by_output) * stiffness;
    decay = joint.damping * (by_motor / n2 + by_output);
  }
  for (std::size_t j = 0; j < joint.element_count; ++j) {
    const Element& e = joint.elements[j];
    const double along_motor = joint.rigid ? 0 : e.along[motor] * e.along[motor] * by_motor;
    squares += e.stiffness * (along_motor + e.along[output] * e.along[output] * by_output);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    const Friction& f = joint.friction[i];
    const double steep = f.stribeck > 0 ? 0.86 * f.stribeck / f.stribeck_velocity : 0;
    decay += (f.viscous + steep) * (i == motor ? by_motor : by_output);
  }
  return {std::sqrt(squares), decay};
}

/// Where the motor is when the joint rests at q with the torque `through` the gear.
inline double resting_motor_angle(const Joint& joint, double q, double through) noexcept {
  if (joint.rigid) return rigid_motor_angle(joint, q);
  const double base = joint.ratio * q + spring_at(joint.spring, through / joint.ratio).windup;
  const Phase<double> phase = Angle<double>::from_radians(q).phase;
  double theta = base;
  for (int i = 0; i < 50 && !joint.kinematic_error.empty(); ++i) {
    theta =
        base - sum(joint.kinematic_error, Angle<double>::from_radians(theta).phase, phase).value;
  }
  return theta;
}

/// The commands at time t within row i, linear between rows.
inline Command command_at(const Signals& s, std::size_t i, double t) noexcept {
  const std::size_t next = i + 1 < s.size ? i + 1 : i;
  const double share = next > i ? (t - s.time[i]) / (s.time[next] - s.time[i]) : 0;
  const auto between = [&](const double* column) {
    return column != nullptr ? column[i] + share * (column[next] - column[i]) : 0;
  };
  return {between(s.position_command), between(s.velocity_command), between(s.motor_torque)};
}

/// The motor's torque is taken away, its brake falls, or the position of now is held.
inline void stop_now(const Joint& joint, const Options& options, SimulationState& state) noexcept {
  state.stopped = true;
  Motion& m = state.motion;
  state.held = {m.position[output], 0, 0};
  if (options.stop.reaction != Reaction::brake) return;
  m.braked = true;
  for (std::size_t body = joint.rigid ? output : motor; body < 2; ++body) {
    if (m.mode[body] != 0 && may_stick(joint, m, body))
      m.mode[body] = m.velocity[body] < 0 ? -1 : 1;
  }
}

/// What the motor gets from time t on.
inline void drive(const Joint& joint, const Signals& s, const Options& options, std::size_t row,
                  double t, SimulationState& state, Inputs& in) noexcept {
  const bool holds = state.stopped && options.stop.reaction == Reaction::hold_position;
  if (options.servo.period > 0 && (!state.stopped || holds)) {
    const double early = 1e-9 * options.servo.period;
    if (state.next_tick <= t + early) {
      const Command command = holds ? state.held : command_at(s, row, t);
      state.servo_torque = servo_step(options.servo, joint, command, state.motion, state.servo);
      state.next_tick = (state.next_tick < t - early ? t : state.next_tick) + options.servo.period;
    }
    in.motor_torque = {state.servo_torque, 0};
  } else if (state.stopped) {
    in.motor_torque = {};
  }
}

/// How many steps a stretch takes.
inline std::int64_t steps_of(const Options& options, double length, bool braked) noexcept {
  // A brake is stepped by order 4, which needs a fifth of the other's step for the same error.
  const bool shorter = options.order == 6 && braked;
  const double wanted = length / options.longest_step * (shorter ? 5 : 1);
  auto count = static_cast<std::int64_t>(wanted);
  if (wanted > static_cast<double>(count) * (1 + 1e-12)) ++count;
  return count < 1 ? 1 : count;
}

/// What one call remembers besides the state of the simulation.
struct RunState {
  double stiffest = 0;  ///< Nm/rad at the motor side, of the spring
  SeriesStepControl control;
  Straight straight;
  Rows rows;
};

/// Steps or series steps from t to `end`, which has no jump in it.
inline Fault integrate_interval(const Joint& joint, const Inputs& in, const Options& options,
                                double t, double end, Motion& m, RunState& run) noexcept {
  if (run.control.accuracy > 0 && !m.braked) {
    return series_steps(joint, in, t, end, run.control, m, run.rows);
  }
  const double length = end - t;
  const std::int64_t count = steps_of(options, length, m.braked);
  const double h = count == 1 ? length : length / static_cast<double>(count);
  const StepsFunction go = steps_for(joint, options.order, m.braked);
  return go(joint, in, t, h, count, options.coarsest, m, run.stiffest);
}

/// Temperatures after `length` seconds in which the work grew from `before`.
inline void heat_up(const Joint& joint, const Work& before, double room, double length,
                    Motion& m) noexcept {
  const Work& w = m.work;
  thermal_step(joint,
               {w.copper - before.copper + w.friction[motor] - before.friction[motor],
                w.friction[output] - before.friction[output] + w.gear - before.gear},
               room, length, m);
}

/// From row i to row `last`.
inline Fault run_rows(const Joint& joint, const Signals& s, const Options& options, std::size_t i,
                      std::size_t last, SimulationState& state, Inputs& in,
                      RunState& run) noexcept {
  double t = s.time[i];
  const double end = s.time[last];
  while (t < end) {
    if (!state.stopped && t >= state.stop_time) stop_now(joint, options, state);
    drive(joint, s, options, i, t, state, in);
    double next = end;
    if (options.servo.period > 0 && state.next_tick > t && state.next_tick < next) {
      next = state.next_tick;
    }
    if (!state.stopped && state.stop_time > t && state.stop_time < next) next = state.stop_time;
    if (end - next < 1e-9 * (end - s.time[i])) next = end;
    const Work before = state.motion.work;
    const Fault fault = integrate_interval(joint, in, options, t, next, state.motion, run);
    if (fault != Fault::none) return fault;
    heat_up(joint, before, at_or(s.room_temperature, i, 25), next - t, state.motion);
    t = next;
  }
  return Fault::none;
}

/// The row up to which a series step may go from row i: the next one where anything happens at
/// rows.
inline std::size_t last_of(const Joint& joint, const Signals& s, const Options& options,
                           std::size_t i, const SimulationState& state, RunState& run) noexcept {
  const Thermal& th = joint.thermal;
  const Stop& stop = options.stop;
  const bool warm = th.motor_capacity > 0 || th.body_capacity > 0 ||
                    s.room_temperature != nullptr || state.motion.temperature[motor] != 25 ||
                    state.motion.temperature[output] != 25;
  const bool driven = options.servo.period > 0 || state.stopped || state.stop_time < 1e300;
  if (run.control.accuracy == 0 || warm || driven || stop.threshold < 1e300) return i + 1;
  return run.straight.last(s, i);
}

/// Watches the torque through the sensor at a row that is written.
inline void watch(const Joint& joint, const Inputs& in, const Options& options, double t,
                  SimulationState& state) noexcept {
  if (state.stopped || state.stop_time < 1e300 || options.stop.threshold >= 1e300) return;
  Motion m = state.motion;
  const Torques at = torques(joint, in, t, m);
  const double a = slopes(joint, at, m)[output].acceleration;
  const double through = outer_load(at, m) - at.outside.ripple + joint.link_inertia * a;
  if (math::absolute(through) > options.stop.threshold) state.stop_time = t + options.stop.delay;
}

/// Bodies at rest stick or slide, the obstacle is touched or not, temperatures act.
inline void begin(const Joint& joint, const Inputs& in, double t, const Options& options,
                  SimulationState& state) noexcept {
  Motion& m = state.motion;
  state.stop_time = options.stop.time;
  warm_up(joint, m);
  m.error = error_at(joint, m);
  const Obstacle& o = joint.obstacle;
  m.contact = o.stiffness > 0 && o.direction * (m.position[output] - o.angle) > 0;
  for (std::size_t j = 0; j < joint.element_count; ++j) {
    m.anchor[j] = stretch(joint.elements[j], m);
  }
  for (std::size_t body = joint.rigid ? output : motor; body < 2; ++body) {
    m.mode[body] = m.velocity[body] < 0 && may_stick(joint, m, body) ? -1 : 1;
  }
  for (std::size_t body = joint.rigid ? output : motor; body < 2; ++body) {
    if (m.velocity[body] == 0 && may_stick(joint, m, body)) settle(joint, in, t, m, body);
  }
}

/// Where it begins: series steps only of a joint that can, as accurate as the options say.
inline RunState run_state_of(const Joint& joint, const Signals& s, const Options& options,
                             const SimulationState& state, const Record& record) noexcept {
  RunState run{
      state.motion.spring.stiffness, {}, {}, {s.time, 1, 1, record, record.needs_torques()}};
  if (options.accuracy > 0 && expandable(joint)) {
    run.control.accuracy = options.accuracy;
    run.control.order = best_order(options.accuracy);
    run.control.shortest = options.shortest_series_step;
    run.control.radius = options.longest_step;
    run.straight = Straight::of(s);
  }
  return run;
}

/// Simulates all rows. `state` holds where it starts, and in the end where it is; `fresh` says that
/// only positions, velocities and temperatures of it are given.
inline Outcome simulate(const Joint& joint, const Signals& s, const Options& options, bool fresh,
                        SimulationState& state, const Record& record) noexcept {
  state.motion.spring = spring_at(joint.spring, state.motion.spring.torque);
  RunState run = run_state_of(joint, s, options, state, record);
  Inputs in = inputs_of(s, 0, 1);
  drive(joint, s, options, 0, s.time[0], state, in);
  if (fresh) begin(joint, in, s.time[0], options, state);
  Outcome outcome;
  for (std::size_t i = 0;; i = run.rows.end) {
    run.rows.end = i + 1 < s.size ? last_of(joint, s, options, i, state, run) : i;
    run.rows.next = i + 1;
    if (i > 0) in = inputs_of(s, i, run.rows.end);
    if (!state.stopped && s.time[i] >= state.stop_time) stop_now(joint, options, state);
    drive(joint, s, options, i, s.time[i], state, in);
    if (run.rows.all) {
      write_all(joint, in, s.time[i], state.motion, state.stopped, i, record);
    } else {
      write_motion(joint, state.motion, i, record);
    }
    if (i + 1 == s.size) break;
    watch(joint, in, options, s.time[i], state);
    outcome.fault = run_rows(joint, s, options, i, run.rows.end, state, in, run);
    if (outcome.fault != Fault::none) break;
  }
  outcome.row = run.rows.next - 1;
  outcome.largest_phase = fastest(joint, run.stiffest).frequency * options.longest_step;
  outcome.longest_series_step = run.control.longest;
  return outcome;
}

}  // namespace flexspline::batch::simulation
