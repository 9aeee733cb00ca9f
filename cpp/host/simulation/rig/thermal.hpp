/// Temperatures of motor and joint body: two heat capacities, implicit midpoint rule.
///
///   C_m Ṫ_m = P_copper + P_motor friction − G_mb (T_m − T_b) − G_m (T_m − T_r)
///   C_b Ṫ_b = P_output friction + P_gear  + G_mb (T_m − T_b) − G_b (T_b − T_r)
///
/// Powers are the mean ones of the stretch before. A capacity of 0 keeps the room's temperature.
#pragma once

#include "host/simulation/rig/joint.hpp"

namespace flexspline::batch::simulation {

/// Friction's factors of both sides at the temperatures of `m`.
inline void warm_up(const Joint& joint, Motion& m) noexcept {
  for (std::size_t i = 0; i < 2; ++i) m.warm[i] = warmth(joint.friction[i], m.temperature[i]);
}

/// Advances by h seconds in which `heat` came in, J.
inline void thermal_step(const Joint& joint, const std::array<double, 2>& heat, double room,
                         double h, Motion& m) noexcept {
  const Thermal& th = joint.thermal;
  const bool motor_moves = th.motor_capacity > 0;
  const bool body_moves = th.body_capacity > 0;
  const bool as_room = m.temperature[motor] == room && m.temperature[output] == room;
  if (!motor_moves && !body_moves && as_room) return;
  if (!motor_moves) m.temperature[motor] = room;
  if (!body_moves) m.temperature[output] = room;
  const double half = h / 2;
  const double a = motor_moves ? half / th.motor_capacity : 0;
  const double b = body_moves ? half / th.body_capacity : 0;
  const double tm = m.temperature[motor];
  const double tb = m.temperature[output];
  // Midpoint values solve: (1 + a (G_mb + G_m)) x − a G_mb y = tm + a (P_m + G_m T_r), …
  const double p =
      tm + (motor_moves ? heat[motor] / (2 * th.motor_capacity) : 0) + a * th.motor_to_room * room;
  const double r =
      tb + (body_moves ? heat[output] / (2 * th.body_capacity) : 0) + b * th.body_to_room * room;
  const double xx = 1 + a * (th.motor_to_body + th.motor_to_room);
  const double yy = 1 + b * (th.motor_to_body + th.body_to_room);
  const double xy = a * th.motor_to_body;
  const double yx = b * th.motor_to_body;
  const double determinant = xx * yy - xy * yx;
  if (motor_moves) m.temperature[motor] = 2 * (p * yy + xy * r) / determinant - tm;
  if (body_moves) m.temperature[output] = 2 * (r * xx + yx * p) / determinant - tb;
  warm_up(joint, m);
}

}  // namespace flexspline::batch::simulation
