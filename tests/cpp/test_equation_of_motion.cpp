/// The equation of motion written down a second time, from the physics: steps, series and the fitted
/// plant are held to it over random joints and states.
#include <doctest/doctest.h>

#include <cmath>
#include <random>
#include <vector>

#include "host/simulation/fitted/drive.hpp"
#include "host/simulation/rig/simulate.hpp"

using namespace flexspline;
using namespace flexspline::batch::simulation;

namespace forward = flexspline::batch::forward;

namespace {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double in(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double either(double a, double b) { return in(0, 1) < 0.5 ? a : b; }
  /// A number, or 0 half of the time.
  double maybe(double low, double high) { return either(0, 1) * in(low, high); }

 private:
  std::mt19937 engine_;
};

/// Σ a cos(o (n_θ θ + n_q q) + φ) with its derivatives by θ and q.
struct Written {
  double value = 0, by_theta = 0, by_q = 0;
};
Written written(const Waves& waves, double theta, double q) {
  Written sum;
  for (const Wave& w : waves) {
    const double phase =
        2 * math::pi<double> * std::ldexp(static_cast<double>(w.phase.fraction), -64);
    const double x = w.order * (w.turning.motor * theta + w.turning.output * q) + phase;
    sum.value += w.amplitude * std::cos(x);
    sum.by_theta -= w.amplitude * w.order * w.turning.motor * std::sin(x);
    sum.by_q -= w.amplitude * w.order * w.turning.output * std::sin(x);
  }
  return sum;
}

/// The wave generator's torque at a wind-up, by bisection of (15) and (16).
double spring_torque(const Spring& s, double n, double windup) {
  const auto windup_at = [&](double torque) {
    double u = 0;
    if (s.mesh_stiffness > 0) {
      const double c = s.mesh_shape;
      const double x = n * torque;
      u += n * (c > 0 ? std::atan(c * x) / c : x) / s.mesh_stiffness;
    }
    if (s.wave_generator_stiffness > 0) {
      const double c = s.wave_generator_shape;
      const double x = c > 0 ? -std::expm1(-c * std::abs(torque)) / c : std::abs(torque);
      u += std::copysign(x, torque) / s.wave_generator_stiffness;
    }
    return u;
  };
  double low = -1000;
  double high = 1000;
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    (windup_at(middle) < windup ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// Friction of one side against a motion with the velocity v, without the part of the load.
double friction_without_load(const Friction& f, double v, double temperature, double share,
                             double brake) {
  const double above = temperature - f.reference_temperature;
  const double cold = std::exp(-f.coulomb_fade * above);
  const double thick = std::exp(-f.viscous_fade * above);
  const double w = std::abs(v);
  const double level = cold * (v < 0 ? f.coulomb_backward : f.coulomb_forward) * share + brake;
  const double hump = cold * f.stribeck * std::exp(-std::pow(w / f.stribeck_velocity, 2));
  const double grows = thick * (f.viscous * w + f.quadratic * w * w + f.cubic * w * w * w);
  return (v < 0 ? -1 : 1) * (level + hump + grows);
}
double load_share(const Friction& f, double v) { return v < 0 ? f.load_backward : f.load_forward; }

/// θ̈ and q̈, with a bound of what the torques add up to, for tolerances.
struct Accelerations {
  std::array<double, 2> of{};
  std::array<double, 2> size{};
};

/// The root of a falling function.
template <typename Function>
double falling_root(const Function& f) {
  double low = -1e7;
  double high = 1e7;
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    (f(middle) > 0 ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// What the output pushes on outside.
double outside_of(const Joint& j, double load, double theta, double q, double v) {
  const double torque =
      load + j.gravity * std::sin(q - j.gravity_angle) + written(j.output_ripple, theta, q).value;
  const double depth = j.obstacle.direction * (q - j.obstacle.angle);
  if (!(j.obstacle.stiffness > 0 && depth > 0)) return torque;
  const double rate = j.obstacle.direction * v;
  return torque +
         j.obstacle.direction * j.obstacle.stiffness * depth * (1 + j.obstacle.dissipation * rate);
}

/// What springs and slip elements do to the bodies, and what of it goes through the gear.
struct Gearing {
  double on_motor = 0, on_output = 0, transmitted = 0;
};
Gearing gearing(const Joint& j, const Motion& m, bool rigid) {
  const double theta = m.position[motor];
  const double q = m.position[output];
  Written error;
  Gearing sum;
  if (!rigid) {
    error = written(j.kinematic_error, theta, q);
    const double spring = spring_torque(j.spring, j.ratio, theta - j.ratio * q + error.value);
    sum = {-spring * (1 + error.by_theta), spring * (j.ratio - error.by_q),
           spring * (j.ratio - error.by_q)};
  }
  for (std::size_t i = 0; i < j.element_count; ++i) {
    const auto [a, b] = j.elements[i].along;
    const double within = a != 0 && b != 0 ? 1 : 0;  // the gear, so that it sees the error
    const double y = a * (theta + within * error.value) + b * q;
    const double z = m.slip[i] != 0 ? m.slip[i] * j.elements[i].level
                                    : j.elements[i].stiffness * (y - m.anchor[i]);
    const double to_output = -z * (b + within * a * error.by_q);
    sum.on_motor -= z * a * (1 + within * error.by_theta);
    sum.on_output += to_output;
    sum.transmitted += within * to_output;
  }
  return sum;
}

Accelerations expected(const Joint& j, double motor_torque, double load, const Motion& m) {
  const double n = j.ratio;
  const double q = m.position[output];
  const double v = m.velocity[output];
  const bool rigid = j.spring.mesh_stiffness == 0 && j.spring.wave_generator_stiffness == 0;
  const double theta =
      rigid ? n * q - written(j.kinematic_error, n * q, q).value : m.position[motor];
  const double omega = rigid ? n * v : m.velocity[motor];
  const double driven =
      motor_torque + written(j.current_ripple, theta, q).value - written(j.cogging, theta, q).value;
  const double outside = outside_of(j, load, theta, q, v);
  const Gearing gear = gearing(j, m, rigid);
  const Friction& fm = j.friction[motor];
  const Friction& fo = j.friction[output];
  const double brake = m.braked ? j.brake : 0;
  const double share = 1 + written(j.friction_ripple, theta, q).value;
  const double at_motor = friction_without_load(fm, omega, m.temperature[motor], 1, brake);
  const double at_output = friction_without_load(fo, v, m.temperature[output], share, 0);
  const double on_motor = driven + gear.on_motor - at_motor;
  const double on_output = gear.on_output - outside - at_output;
  const double at_stake = std::abs(gear.on_output) + std::abs(outside) + std::abs(at_output);
  Accelerations out;
  if (!rigid) {
    const double damped = j.damping * (omega / n - v);
    const double load_on_motor = load_share(fm, omega) * std::abs(gear.transmitted) / n;
    const double load_on_output = load_share(fo, v) * std::abs(gear.transmitted);
    out.of = {(on_motor - damped / n - std::copysign(load_on_motor, omega)) / j.motor_inertia,
              (on_output + damped - std::copysign(load_on_output, v)) / j.output_inertia};
    out.size = {(std::abs(driven) + std::abs(gear.on_motor) + std::abs(at_motor)) / j.motor_inertia,
                at_stake / j.output_inertia};
    return out;
  }
  const double mass = j.output_inertia + n * n * j.motor_inertia;
  const double factor = load_share(fo, v) + load_share(fm, v);
  out.of[output] = falling_root([&](double a) {
    const double carried = std::abs(outside + j.output_inertia * a);
    return on_output + n * (driven - at_motor) - std::copysign(factor * carried, v) - mass * a;
  });
  out.size[output] = (at_stake + std::abs(n * driven) + std::abs(n * at_motor)) / mass;
  return out;
}

Friction random_friction(Random& random, double scale, double speed, bool smooth) {
  Friction f;
  f.viscous = random.maybe(0, scale);
  f.cubic = random.maybe(0, scale / speed / speed);
  f.viscous_fade = random.maybe(-0.02, 0.02);
  if (smooth) return f;
  f.coulomb_forward = random.maybe(0, scale);
  f.coulomb_backward = random.maybe(0, scale);
  f.load_forward = random.maybe(0, 0.3);
  f.load_backward = random.maybe(0, 0.3);
  f.stribeck = random.maybe(0, scale);
  f.stribeck_velocity = random.in(0.2, 1) * speed;
  f.quadratic = random.maybe(-0.1, 0.3) * scale / speed;
  f.coulomb_fade = random.maybe(-0.02, 0.02);
  return f;
}

Waves random_waves(Random& random, double amplitude) {
  Waves waves;
  const std::array<Turning, 4> turnings{{{0, 1}, {1, 0}, {1, 1}, {1, -1}}};
  for (int i = 0; i < 2; ++i) {
    waves.push_back({random.maybe(0, amplitude), static_cast<std::uint32_t>(random.in(1, 5)),
                     Angle<double>::from_radians(random.in(-3, 3)).phase,
                     turnings[static_cast<std::size_t>(random.in(0, 4))]});
  }
  return waves;
}

/// Smooth: what a power series can take.
Joint random_joint(Random& random, bool rigid, bool smooth) {
  Joint j;
  j.ratio = random.in(30, 160);
  j.motor_inertia = random.in(2e-5, 2e-4);
  j.output_inertia = random.in(0.2, 2);
  j.gravity = random.maybe(0, 40);
  j.gravity_angle = random.in(-3, 3);
  j.brake = random.in(0, 2);
  j.friction = {random_friction(random, 0.02, j.ratio, smooth),
                random_friction(random, 2, 1, smooth)};
  if (!rigid) {
    j.damping = random.maybe(0, 10);
    j.spring.mesh_stiffness = random.in(5e3, 3e4);
    j.spring.mesh_shape = random.maybe(0.005, 0.02);
  }
  if (smooth) return prepared(j);
  if (!rigid && random.either(0, 1) == 1) {
    j.spring.wave_generator_stiffness = random.in(20, 60);
    j.spring.wave_generator_shape = random.maybe(0.05, 0.3);
  }
  j.kinematic_error = random_waves(random, 1e-3);
  j.current_ripple = random_waves(random, 0.02);
  j.cogging = random_waves(random, 0.02);
  j.output_ripple = random_waves(random, 1);
  j.friction_ripple = random_waves(random, 0.3);
  if (random.either(0, 1) == 1) {
    j.obstacle = {random.in(-1, 1), random.either(-1, 1) < 0 ? -1 : 1, 500, random.maybe(0, 2)};
  }
  for (std::size_t i = 0; i < 3; ++i) {  // hysteresis in the gear, presliding at either side
    const std::array<std::array<double, 2>, 3> along{{{1 / j.ratio, -1}, {0, 1}, {1, 0}}};
    if (rigid && i != 1) continue;
    j.elements[j.element_count++] = {random.in(100, 2000), random.in(1, 5), along[i]};
  }
  return prepared(j);
}

/// A motion in which all bodies slide, far from the pole of the spring.
Motion random_motion(Random& random, const Joint& j) {
  Motion m;
  m.position[output] = random.in(-2, 2);
  const double most = 0.6 / std::max(j.spring.mesh_bend, 12.0);
  m.position[motor] = j.ratio * m.position[output] + random.in(-most, most);
  m.velocity[output] = random.either(-1, 1) * random.in(0.2, 2);
  if (!j.rigid) m.velocity[motor] = j.ratio * random.either(-1, 1) * random.in(0.2, 2);
  for (const std::size_t body : {motor, output}) {
    m.mode[body] = m.velocity[body] < 0 ? -1 : 1;
    m.temperature[body] = random.in(0, 60);
  }
  m.spring = spring_at(j.spring, 0);
  m.error = error_at(j, m);
  warm_up(j, m);
  m.braked = random.either(0, 1) == 1;
  const double depth = j.obstacle.direction * (m.position[output] - j.obstacle.angle);
  m.contact = j.obstacle.stiffness > 0 && depth > 0;
  for (std::size_t i = 0; i < j.element_count; ++i) {
    m.slip[i] = static_cast<int>(random.in(0, 3)) - 1;
    m.anchor[i] = stretch(j.elements[i], m) + random.in(-1e-3, 1e-3);
  }
  return m;
}

Inputs random_inputs(Random& random) {
  return {0, {random.in(-0.5, 0.5), random.in(-1, 1)}, {random.in(-20, 20), random.in(-5, 5)}};
}

/// How far the velocities of two steps of ±h are apart, over their time.
template <typename Step>
std::array<double, 2> difference_of_steps(const Step& step, double h) {
  const std::array<double, 2> later = step(h);
  const std::array<double, 2> before = step(-h);
  return {(later[0] - before[0]) / (2 * h), (later[1] - before[1]) / (2 * h)};
}

/// The acceleration at the start of a step, to fourth order in h.
template <typename Step>
std::array<double, 2> acceleration_of(const Step& step, double h) {
  const std::array<double, 2> fine = difference_of_steps(step, h);
  const std::array<double, 2> coarse = difference_of_steps(step, 2 * h);
  return {(4 * fine[0] - coarse[0]) / 3, (4 * fine[1] - coarse[1]) / 3};
}

/// The bodies that a joint has.
std::size_t first_body(const Joint& j) { return j.rigid ? output : motor; }

}  // namespace

TEST_CASE("a step starts with the accelerations of the equation of motion") {
  Random random(11);
  for (int i = 0; i < 2000; ++i) {
    const Joint j = random_joint(random, i % 2 == 0, i % 5 == 0);
    const Inputs in = random_inputs(random);
    const Motion m = random_motion(random, j);
    const Accelerations wanted = expected(j, in.motor_torque.value, in.load.value, m);
    Motion at = m;
    const Slopes found = slopes(j, torques(j, in, 0, at), at);
    const auto step = [&](double h) {
      Motion moved = m;
      smooth_step(j, in, 0, h, moved);
      return moved.velocity;
    };
    // ω h and the decay in a step are below 0.01, and a load that passes zero in it, where its
    // friction has a kink, is rare; rounding: 1e-16 of a velocity in 3e-7 s
    const std::array<double, 2> stepped = acceleration_of(step, 3e-7);
    for (std::size_t body = first_body(j); body < 2; ++body) {
      const double tolerance = 1e-10 * (wanted.size[body] + 1);
      CHECK(std::abs(found[body].acceleration - wanted.of[body]) < tolerance);
      const double rounding = 1e-9 * std::abs(m.velocity[body]);
      CHECK(std::abs(stepped[body] - wanted.of[body]) < 1e-6 * (wanted.size[body] + 1) + rounding);
    }
  }
}

TEST_CASE("a series starts with the accelerations of the equation of motion, and steps agree") {
  Random random(12);
  const auto check = [&]<Kind kind>() {
    const Joint j = random_joint(random, kind == Kind::smooth_rigid, true);
    REQUIRE(j.kind == kind);
    const Inputs in = random_inputs(random);
    Motion m = random_motion(random, j);
    m.braked = false;
    const Accelerations wanted = expected(j, in.motor_torque.value, in.load.value, m);
    Expansion e;
    e.unit = 1e-5;
    first_terms<kind>(j, in, 0, m, e);
    while (e.order < 10) extend<kind>(j, e);
    Motion by_steps = m;
    for (int i = 0; i < 10; ++i) smooth_step<kind, 6>(j, in, i * 1e-6, 1e-6, by_steps);
    Motion by_series = m;
    move<kind>(j, e, 1, by_series);
    for (std::size_t body = first_body(j); body < 2; ++body) {
      const double tolerance = 1e-10 * (wanted.size[body] + 1);
      CHECK(std::abs(e.velocity[body][1] / e.unit - wanted.of[body]) < tolerance);
      const double rounding = 1e-14 * std::abs(m.velocity[body]);
      CHECK(std::abs(by_series.velocity[body] - by_steps.velocity[body]) <
            1e-10 * e.unit * (wanted.size[body] + 1) + rounding);
    }
  };
  for (int i = 0; i < 500; ++i) {
    check.template operator()<Kind::smooth_mesh>();
    check.template operator()<Kind::smooth_rigid>();
  }
}

TEST_CASE("the fitted plant has the acceleration of the equation of motion") {
  Random random(13);
  for (int i = 0; i < 2000; ++i) {
    Joint j;  // the plant's gear is rigid, its inertia all at the output
    j.ratio = 100;
    j.output_inertia = random.in(0.2, 2);
    j.gravity = random.maybe(0, 40);
    j.gravity_angle = random.in(-3, 3);
    Friction& f = j.friction[output];
    f.coulomb_forward = f.coulomb_backward = random.maybe(0, 2);
    f.load_forward = f.load_backward = random.maybe(0, 0.3);
    f.stribeck = random.maybe(0, 2);
    f.viscous = random.maybe(0, 3);
    j = prepared(j);
    std::vector<batch::AnyEffect> effects;
    std::vector<double> coefficients;
    const auto add = [&](const char* name, std::initializer_list<double> values) {
      effects.push_back(batch::effect_by_name(name));
      coefficients.insert(coefficients.end(), values);
    };
    add("inertia", {j.output_inertia});
    add("gravity", {j.gravity * std::cos(j.gravity_angle), -j.gravity * std::sin(j.gravity_angle)});
    add("coulomb_friction", {f.coulomb_forward});
    add("load_dependent_friction", {f.load_forward});
    add("stribeck_friction", {f.stribeck});
    add("viscous_friction", {f.viscous});
    const forward::Plant plant(effects, coefficients,
                               Gear<double>::from_ratio(100, OutputSpline::unknown, false), 0);
    Motion m;
    m.position[output] = random.in(-2, 2);
    m.velocity[output] = random.either(-1, 1) * random.in(0.02, 2);
    const Inputs rig = random_inputs(random);
    forward::Inputs in;  // a torque counted at the output
    in.motor = {j.ratio * rig.motor_torque.value, j.ratio * rig.motor_torque.slope};
    in.known_load = rig.load;
    const Accelerations wanted = expected(j, rig.motor_torque.value, rig.load.value, m);
    const int way = m.velocity[output] < 0 ? -1 : 1;
    forward::Memories none = plant.fresh();
    const double found =
        plant.acceleration(in, 0, m.position[output], m.velocity[output], way, none);
    CHECK(std::abs(found - wanted.of[output]) < 1e-10 * (wanted.size[output] + 1));
    const auto step = [&](double h) {
      forward::Motion moved{m.position[output], m.velocity[output], way, plant.fresh()};
      return std::array{0.0, forward::runge_kutta(plant, in, 0, h, moved).velocity};
    };
    const double stepped = acceleration_of(step, 1e-5)[output];
    CHECK(std::abs(stepped - wanted.of[output]) < 1e-6 * (wanted.size[output] + 1));
  }
}
