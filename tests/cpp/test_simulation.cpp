#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "host/simulation/rig/simulate.hpp"
#include "mesh_joint.hpp"

using namespace flexspline;
using namespace flexspline::batch::simulation;

namespace {

Joint two_masses() {
  Joint joint = mesh_joint();
  joint.spring.wave_generator_stiffness = 21.9931;
  joint.spring.wave_generator_shape = 3.125;
  return joint;
}

Motion wound_up(const Joint& joint) {
  Motion m;
  m.position = {0.3 * joint.ratio + 0.05, 0.3};
  m.velocity = {2.0, -0.4};
  m.spring = spring_at(joint.spring, 0);
  return m;
}

}  // namespace

TEST_CASE("a step without losses is undone by turning the velocities round") {
  const Joint joint = prepared(two_masses());
  const Motion start = wound_up(joint);
  Motion m = start;
  for (int i = 0; i < 1000; ++i) smooth_step(joint, {}, 0, 5e-4, m);
  CHECK(std::abs(m.position[output] - start.position[output]) > 0.01);
  for (double& v : m.velocity) v = -v;
  for (int i = 0; i < 1000; ++i) smooth_step(joint, {}, 0, 5e-4, m);
  // rounding of a thousand steps and back, of angles of 30 rad
  CHECK(m.position[motor] == doctest::Approx(start.position[motor]).epsilon(1e-11));
  CHECK(m.position[output] == doctest::Approx(start.position[output]).epsilon(1e-10));
  CHECK(-m.velocity[motor] == doctest::Approx(start.velocity[motor]).epsilon(1e-8));
}

TEST_CASE("the derivatives of the spring and of friction are those of their values") {
  const Spring spring = prepared(two_masses()).spring;
  for (const double torque : {-1.5, -0.2, 0.01, 0.7, 3.0}) {
    const double d = 1e-4;
    const SpringPoint p = spring_at(spring, torque);
    const double up = spring_at(spring, torque + d).windup;
    const double down = spring_at(spring, torque - d).windup;
    CHECK((up - down) / (2 * d) * p.stiffness == doctest::Approx(1).epsilon(1e-6));
    CHECK((up - 2 * p.windup + down) / (d * d) * p.stiffness ==
          doctest::Approx(p.bend).epsilon(1e-4));
    SpringPoint near = spring_at(spring, 0);
    CHECK(torque_of(spring, p.windup, near) == doctest::Approx(torque).epsilon(1e-13));
  }
  Friction friction;
  friction.stribeck = 1.3;
  friction.viscous = 2;
  friction.quadratic = -0.4;
  friction.cubic = 0.3;
  const auto at = [&](double w) {
    Resistance r;
    add_resistance(friction, {1.1, 0.9}, 3.0, w, r);
    return r;
  };
  for (const double w : {0.0, 0.01, 0.05, 0.4}) {
    const double d = 1e-5;
    CHECK((at(w + d).value - at(w - d).value) / (2 * d) ==
          doctest::Approx(at(w).first).epsilon(1e-5));
    CHECK((at(w + d).first - at(w - d).first) / (2 * d) ==
          doctest::Approx(at(w).second).epsilon(1e-5));
    CHECK((at(w + d).second - at(w - d).second) / (2 * d) ==
          doctest::Approx(at(w).third).epsilon(1e-4));
  }
}

TEST_CASE("a part of the gear that is rigid makes no difference by its shape") {
  const auto same = [](Spring shaped) {
    Spring plain = shaped;
    (shaped.mesh_stiffness == 0 ? plain.mesh_shape : plain.wave_generator_shape) = 0;
    shaped = prepared(shaped);
    plain = prepared(plain);
    SpringPoint near = spring_at(shaped, 0);
    SpringPoint expected = spring_at(plain, 0);
    CHECK(has_pole(shaped) == has_pole(plain));
    for (const double windup : {-0.02, 0.0, 0.001, 0.03}) {
      CHECK(torque_of(shaped, windup, near) == torque_of(plain, windup, expected));
    }
    CHECK(torque_of(shaped, 0.02, near) > 0);
  };
  same({.ratio = 101, .mesh_stiffness = 15548, .wave_generator_shape = 3.125});
  same({.ratio = 101, .mesh_stiffness = 15548, .mesh_shape = 0.05, .wave_generator_shape = 3.125});
  same({.ratio = 101, .mesh_shape = 0.05, .wave_generator_stiffness = 22});
  same({.ratio = 101,
        .mesh_shape = 0.05,
        .wave_generator_stiffness = 22,
        .wave_generator_shape = 3.125});
}

TEST_CASE("the force of the gear is the slope of its energy") {
  const Spring spring = prepared(two_masses()).spring;
  for (const double torque : {-2.0, -0.3, 0.02, 0.5, 2.5}) {
    const double d = 1e-4;
    const double energy = stored_energy(spring, torque + d) - stored_energy(spring, torque - d);
    const double way = spring_at(spring, torque + d).windup - spring_at(spring, torque - d).windup;
    CHECK(energy / way == doctest::Approx(torque).epsilon(1e-6));
  }
}

TEST_CASE("a body that sticks keeps every bit of its place") {
  Joint joint = two_masses();
  joint.gravity = 0;
  joint.friction[motor].coulomb_forward = joint.friction[motor].coulomb_backward = 0.2;
  joint.friction[output].coulomb_forward = joint.friction[output].coulomb_backward = 1;
  joint = prepared(joint);
  const std::vector<double> time{0, 0.1, 0.2, 0.3};
  const std::vector<double> load(4, 15.0);
  std::vector<double> q(4);
  std::vector<double> theta(4);
  Signals signals;
  signals.time = time.data();
  signals.size = time.size();
  signals.load_torque = load.data();
  Record record;
  record.column[0] = q.data();
  record.column[3] = theta.data();
  SimulationState state;
  state.motion.position = {resting_motor_angle(joint, 0, 15.0), 0};
  const Outcome outcome = simulate(joint, signals, {}, true, state, record);
  CHECK(outcome.fault == batch::simulation::Fault::none);
  for (std::size_t i = 1; i < time.size(); ++i) {
    CHECK(q[i] == q[0]);
    CHECK(theta[i] == theta[0]);
  }
}

TEST_CASE("beyond its pole the spring is infinite, before it finite") {
  const Spring spring = prepared(two_masses()).spring;
  const double pole = 101 * math::pi<double> / 2 / (0.0487 * 15548) + 1 / (3.125 * 21.9931);
  SpringPoint near = spring_at(spring, 0);
  CHECK(std::isfinite(torque_of(spring, -0.999 * pole, near)));
  CHECK(std::isinf(torque_of(spring, 1.001 * pole, near)));
  CHECK(torque_of(spring, 0, near) == doctest::Approx(0));
}
