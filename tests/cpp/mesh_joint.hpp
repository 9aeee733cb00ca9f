/// A joint of the simulation that tests of its steps start from.
#pragma once

#include "host/simulation/rig/joint.hpp"

namespace flexspline::batch::simulation {

/// Two masses under gravity with a mesh between them that stiffens; no losses.
inline Joint mesh_joint() {
  Joint joint;
  joint.ratio = 101;
  joint.motor_inertia = 1e-4;
  joint.output_inertia = 0.5;
  joint.gravity = 20;
  joint.spring.mesh_stiffness = 15548;
  joint.spring.mesh_shape = 0.0487;
  return joint;
}

}  // namespace flexspline::batch::simulation
