/// What surrounds a simulated joint: a stop in its way, and where its heat goes.
#pragma once

namespace flexspline::batch::simulation {

/// A stop in the way of the output: τ = k δ (1 + λ δ̇), δ ≥ 0 the depth.
struct Obstacle {
  double angle = 0;        ///< rad
  int direction = 1;       ///< +1: it stops positive motion
  double stiffness = 0;    ///< k, Nm/rad; 0: there is none
  double dissipation = 0;  ///< λ, s/rad
};

/// Two heat capacities in a row: motor, then the joint's body with the sensor, then the room.
struct Thermal {
  double motor_capacity = 0;  ///< J/K; 0: as the room
  double body_capacity = 0;   ///< J/K; 0: as the room
  double motor_to_body = 0;   ///< W/K
  double motor_to_room = 0;   ///< W/K
  double body_to_room = 0;    ///< W/K
  double copper_loss = 0;     ///< W/Nm², of the motor torque's square
};

}  // namespace flexspline::batch::simulation
