#include <doctest/doctest.h>

#include <cmath>
#include <random>
#include <vector>

#include "host/simulation/fitted/drive.hpp"

using namespace flexspline;
using namespace flexspline::batch;
using namespace flexspline::batch::forward;

namespace {

struct Named {
  const char* name;
  std::vector<double> coefficients;
};

Plant plant_of(const std::vector<Named>& given) {
  std::vector<AnyEffect> effects;
  std::vector<double> coefficients;
  for (const Named& each : given) {
    effects.push_back(effect_by_name(each.name));
    coefficients.insert(coefficients.end(), each.coefficients.begin(), each.coefficients.end());
  }
  return {effects, coefficients, Gear<double>::from_ratio(100, OutputSpline::unknown, false), 0};
}

const std::vector<Named> rough{{"inertia", {0.5}},
                               {"gravity", {8, 1}},
                               {"coulomb_friction", {2}},
                               {"viscous_friction", {3}},
                               {"load_dependent_friction", {0.2}}};

Inputs steady_torque(double torque, double load = 0) {
  Inputs in;
  in.motor = {torque, 0};
  in.known_load = {load, 0};
  return in;
}

}  // namespace

TEST_CASE("the acceleration balances drive, load and friction of that very acceleration") {
  const Plant plant = plant_of(rough);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-20, 20);
  Memories none = plant.fresh();
  for (int i = 0; i < 2000; ++i) {
    const Inputs in = steady_torque(any(random), any(random));
    const double q = 0.1 * any(random);
    const double v = 0.1 * any(random);
    const int way = v > 0 ? 1 : -1;
    const double a = plant.acceleration(in, 0, q, v, way, none);
    const double gravity = 8 * std::sin(q) + std::cos(q);
    const double load = in.known_load.value + gravity + 0.5 * a;
    const double friction = way * (2 + 0.2 * std::abs(load)) + 3 * v;
    const double missing = in.motor.value - in.known_load.value - gravity - friction - 0.5 * a;
    CHECK(std::abs(missing) < 1e-12);
  }
}

TEST_CASE("at rest the excess is that over the one-sided limits of the rows") {
  const Plant plant = plant_of(rough);
  const double q = 0.4;
  const double gravity = 8 * std::sin(q) + std::cos(q);
  const double friction = 2 + 0.2 * gravity;
  for (const double torque : {-10.0, 0.0, 10.0}) {
    const Inputs in = steady_torque(torque);
    const double forward = plant.excess(in, 0, q, 1, plant.fresh());
    const double backward = plant.excess(in, 0, q, -1, plant.fresh());
    CHECK(forward == doctest::Approx(torque - gravity - friction).epsilon(1e-13));
    CHECK(backward == doctest::Approx(torque - gravity + friction).epsilon(1e-13));
  }
}

TEST_CASE("lines of the load are the rows of the effects that have them, and of no others") {
  for (const AnyEffect& any : catalogue()) {
    const bool lines = name_of(any) == "offset" || name_of(any) == "coulomb_friction" ||
                       name_of(any) == "coulomb_friction_per_direction" ||
                       name_of(any) == "load_dependent_friction";
    const bool of_drives = std::visit(
        [](const auto& e) { return e.targets.find('M') != std::string_view::npos; }, any);
    if (!of_drives) continue;
    Member member{any, std::vector<double>(std::max<std::size_t>(terms_of(any), 1), 0.7)};
    for_each_shape(member.effect, [](const auto& shape, double& field) {
      if (shape.name == "direction_width") field = sharp;
    });
    CHECK_MESSAGE(steady(member).has_value() == lines, name_of(any));
  }
}

TEST_CASE("a joint that friction holds stays where it is, whatever the step") {
  const Plant plant = plant_of(rough);
  Motion m;
  m.position = 0.3;
  Inputs in = steady_torque(8 * std::sin(0.3));
  in.motor.slope = 0.5;
  begin(plant, in, m);
  CHECK(m.direction == 0);
  for (int i = 0; i < 100; ++i) step(plant, in, 0.01 * i, 0.01, m);
  CHECK(m.position == 0.3);
  CHECK(m.velocity == 0);
}

TEST_CASE("a step that passes rest ends there, to rounding, however long it is") {
  // v₀ = 1 against (2 + 1) Nm on 0.5 kg m²: rest after 1/6 s at 1/12 rad, then it is held
  const Plant plant = plant_of({{"inertia", {0.5}}, {"coulomb_friction", {2}}});
  for (const double h : {0.5, 0.1, 0.003}) {
    Motion m;
    m.velocity = 1;
    const Inputs in = steady_torque(-1);
    begin(plant, in, m);
    for (int i = 0; i < 200; ++i) step(plant, in, 0, h, m);
    CHECK(m.position == doctest::Approx(1.0 / 12).epsilon(1e-12));
    CHECK(m.direction == 0);
  }
}

TEST_CASE("friction that feeds energy neither sticks nor hangs") {
  const Plant plant = plant_of({{"inertia", {0.5}}, {"coulomb_friction", {-1}}});
  Motion m;
  m.velocity = -0.1;
  const Inputs in = steady_torque(3);
  begin(plant, in, m);
  for (int i = 0; i < 100; ++i) step(plant, in, 0, 0.01, m);
  CHECK(m.velocity > 0);
}

TEST_CASE("a memory starts settled, and holds what it can") {
  const Plant plant = plant_of({{"inertia", {0.5}}, {"presliding_friction", {1, 0.5, 0.3, 0.2}}});
  for (const double torque : {0.0, 1.3, -1.9}) {
    Motion m;
    m.position = 0.7;
    const Inputs in = steady_torque(torque);
    begin(plant, in, m);
    CHECK(plant.settled(m.memories));
    CHECK(std::abs(plant.excess(in, 0, m.position, 1, m.memories)) < 1e-11);  // 480 Nm/rad
  }
  Motion moving;
  moving.velocity = -0.2;
  const Inputs in = steady_torque(0);
  begin(plant, in, moving);
  CHECK(plant.settled(moving.memories));
  CHECK(plant.excess(in, 0, 0, -1, moving.memories) == doctest::Approx(2.0));  // all of it slips
}

TEST_CASE("what cannot be driven is refused") {
  CHECK_THROWS_AS(plant_of({{"viscous_friction", {3}}}), std::invalid_argument);
  CHECK_THROWS_AS(plant_of({{"inertia", {-1}}}), std::invalid_argument);
  CHECK_THROWS_AS(plant_of({{"inertia", {1, 2}}}), std::invalid_argument);
  CHECK_THROWS_AS(plant_of({{"inertia", {}}}), std::invalid_argument);
  CHECK_THROWS_AS(plant_of({{"inertia", {1}}, {"load_dependent_friction", {1}}}),
                  std::invalid_argument);
}

TEST_CASE("motion that runs away ends with its last good row") {
  const Plant plant = plant_of({{"inertia", {0.5}}, {"viscous_friction", {-40}}});
  std::vector<double> time(2000), motor(2000, 1.0), position(2000);
  for (std::size_t i = 0; i < time.size(); ++i) time[i] = 0.001 * static_cast<double>(i);
  Signals signals;
  signals.size = time.size();
  signals.time = time.data();
  signals.motor = motor.data();
  Record record;
  record.position = position.data();
  const std::size_t valid = drive(plant, signals, std::nullopt, 0, 0, 1, record);
  CHECK(valid < time.size());
  CHECK(std::isfinite(position[valid - 1]));
}
