#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "host/simulation/rig/simulate.hpp"
#include "mesh_joint.hpp"

using namespace flexspline;
using namespace flexspline::batch::simulation;

namespace {

Joint smooth_joint() {
  Joint joint = mesh_joint();
  joint.damping = 5;
  joint.friction[motor] = {.viscous = 1e-4, .cubic = 1e-9};
  joint.friction[output] = {.viscous = 2, .cubic = 3};
  return prepared(joint);
}

/// The motion after h seconds by one series of this order, read at a share of it.
Motion after(const Joint& joint, double h, std::size_t order, double share) {
  Motion m;
  m.position = {0.3 * joint.ratio + 0.05, 0.3};
  m.velocity = {2.0, -0.4};
  Expansion e;
  e.unit = h;
  first_terms<Kind::smooth_mesh>(joint, {0, {0.3, -0.02}, {5, -0.2}}, 0, m, e);
  while (e.order < order) extend<Kind::smooth_mesh>(joint, e);
  move<Kind::smooth_mesh>(joint, e, share, m);
  return m;
}

}  // namespace

TEST_CASE("a series is wrong by the order after its last, at its end and on the way") {
  const Joint joint = smooth_joint();
  for (const std::size_t order : {3U, 6U, 9U}) {
    for (const double share : {1.0, 0.4}) {
      std::vector<double> errors;
      for (const double h : {2e-3, 1e-3}) {
        const Motion exact = after(joint, share * h, most_terms, 1);
        const Motion m = after(joint, h, order, share);
        errors.push_back(std::abs(m.velocity[output] - exact.velocity[output]));
      }
      const double found = std::log2(errors[0] / errors[1]);
      CHECK(found == doctest::Approx(static_cast<double>(order + 1)).epsilon(0.1));
    }
  }
}

TEST_CASE("terms of a product, a square, an integral and a value are those of polynomials") {
  const Coefficients a{1, -2, 3, 0.5};
  const Coefficients b{4, 1, -1, 2};
  CHECK(product(a, b, 0) == 4);
  CHECK(product(a, b, 2) == 1 * -1 + -2 * 1 + 3 * 4);
  CHECK(product(a, b, 3) == 1 * 2 + -2 * -1 + 3 * 1 + 0.5 * 4);
  for (std::size_t k = 0; k < 4; ++k) CHECK(square(a, k) == product(a, a, k));
  CHECK(value(a, 3, 2.0) == 1 - 4 + 12 + 4);
  CHECK(value(integral(a, 2, 0.5, 7), 3, 2.0) == doctest::Approx(7 + 0.5 * (2 - 4 + 8)));
}

TEST_CASE("a straight stretch ends at the kink, whatever is tried first") {
  std::vector<double> time(1000);
  std::vector<double> motor_torque(1000);
  std::vector<double> load(1000);
  for (std::size_t k = 0; k < time.size(); ++k) {
    const double t = static_cast<double>(k) / 250;
    time[k] = t;
    motor_torque[k] = 0.3 - 0.02 * t + (k > 700 ? 1e-12 * static_cast<double>(k - 700) : 0);
    load[k] = k < 300 ? 5 - 0.2 * t : 5 + std::sin(t);
  }
  Signals s;
  s.time = time.data();
  s.size = time.size();
  s.motor_torque = motor_torque.data();
  Straight straight = Straight::of(s);
  std::vector<std::size_t> ends{0};
  while (ends.back() + 1 < s.size) ends.push_back(straight.last(s, ends.back()));
  CHECK(std::find(ends.begin(), ends.end(), 700) != ends.end());
  CHECK(ends.size() < 25);
  s.load_torque = load.data();
  straight = Straight::of(s);
  std::size_t i = 0;
  while (i < 299) i = straight.last(s, i);
  CHECK(i == 299);
  for (; i < 999; ++i) CHECK(straight.last(s, i) == i + 1);
}
