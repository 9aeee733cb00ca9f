#include <doctest/doctest.h>

#include <random>

#include "estimator_cases.hpp"
#include "flexspline/coupling.hpp"
#include "flexspline/effects/catalogue.hpp"

using namespace flexspline;

namespace {

template <typename S>
using Gearing =
    Model<S, MeshCompliance<S>, TorsionalHysteresis<S>, Backlash<S>, WaveGeneratorCompliance<S>>;

template <typename S>
constexpr S largest = S(40);

/// A gear whose torsion grows everywhere: the loop sticks with less than half of what the mesh
/// yields at the largest load.
template <typename S>
Gearing<S> gearing() {
  Gearing<S> made{Gear<S>::from_ratio(101, OutputSpline::circular, false), {}};
  std::get<0>(made.parts) = {{.mesh_shape = S(0.02L)}, {{S(0.01L)}}};
  std::get<1>(made.parts) = {{.load_width = S(8)}, {{S(0.004L), S(0.002L), S(0.001L), S(0.0005L)}}};
  std::get<2>(made.parts) = {{.contact_torque = S(0.5L)}, {{S(0.02L)}}};
  std::get<3>(made.parts) = {{.wave_generator_shape = S(3)}, {{S(0.5L)}}};
  return made;
}

/// The least that the torsion of `gearing` grows by: the mesh's at 40 Nm, less what sticks.
template <typename S>
constexpr Coupling<S> coupling{S(101), largest<S>, S(0.01L / 1.64L - 0.002L)};

/// The torsion of a load by the model itself, whose memory moves on.
template <typename S>
S torsion_of(const Gearing<S>& model, S load, typename Gearing<S>::State& state) {
  Sample<S> at;
  at.known_load = load;
  at.motor_torque = load / S(101);
  S torsion = not_a_number<S>;
  REQUIRE(model.predict(at, state, torsion) == Status::ok);
  return torsion;
}

/// A model that counts how often it is asked.
struct Counted {
  using State = Gearing<double>::State;
  const Gearing<double>& model;
  Gear<double> gear = model.gear;
  mutable int asked = 0;
  static constexpr bool remembers = true;
  template <Channel channel>
  static constexpr auto reads() noexcept {
    return Gearing<double>::reads<channel>();
  }
  double carried(const Sample<double>&) const { return 0; }
  double sum(const Sample<double>& at, State& state) const {
    ++asked;
    return model.sum(at, state);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("a load's torsion gives the load back, by way of any loop", S, float, double) {
  const Gearing<S> model = gearing<S>();
  typename Gearing<S>::State there{}, back{};
  std::mt19937 dice(3);
  std::uniform_real_distribution<double> size(-40, 40);
  S torque = 0;
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    // small steps, large ones, and back to the middle of the backlash
    const double scale = k % 3 == 0 ? 1 : k % 3 == 1 ? 1e-2 : 1e-5;
    const S load = S(scale * size(dice));
    const S torsion = torsion_of(model, load, there);
    REQUIRE(coupling<S>.torque(model, {}, torsion, back, torque) == Status::ok);
    worst = std::max(worst, std::abs(double(torque) - double(load)));
  }
  // the rounding of a torsion of up to 0.5 rad, over the least compliance
  CHECK(worst < rounding<S>(4) * 0.5 / 0.004 + rounding<S>(8) * 40);
}

TEST_CASE_TEMPLATE("beyond the largest load a gear is straight, and no stiffer", S, float, double) {
  const Gearing<S> model = gearing<S>();
  for (const S sign : {S(-1), S(1)}) {
    typename Gearing<S>::State state{};
    S torque = 0;
    const S edge = torsion_of(model, sign * largest<S>, state);
    for (const S more : {S(0), S(0.1L), S(10), S(1e6)}) {
      typename Gearing<S>::State memory{};
      S found = 0;
      REQUIRE(coupling<S>.torque(model, {}, edge - sign * more, memory, found) == Status::ok);
      const double expected = 40 + double(more) / double(coupling<S>.least_compliance);
      CHECK(double(sign * found) == doctest::Approx(expected).epsilon(rounding<S>(2000)));
    }
    CHECK(torque == 0);
  }
  CHECK(double(coupling<S>.stiffness()) == doctest::Approx(101 / (0.01 / 1.64 - 0.002)));
}

TEST_CASE("no closed path of the torsion gives work, and a plain spring takes none") {
  std::mt19937 dice(7);
  std::normal_distribution<double> normal;
  for (const bool loops : {true, false}) {
    Gearing<double> model = gearing<double>();
    if (!loops) std::get<1>(model.parts).coefficients = {};
    Gearing<double>::State state{};
    double torque = 0, before = 0, torsion = 0, work = 0, least = 0, most = 0;
    const auto move = [&](double to) {
      REQUIRE(coupling<double>.torque(model, {}, to, state, torque) == Status::ok);
      work += 0.5 * (torque + before) * (torsion - to) / 101;  // of the motor's side, into the gear
      torsion = to;
      before = torque;
      least = std::min(least, work);
      most = std::max(most, work);
    };
    move(0);
    for (int turn = 0; turn < 200; ++turn) {
      const double goal = 0.1 * normal(dice), start = torsion;
      for (int k = 1; k <= 500; ++k) move(start + (goal - start) * k / 500);
    }
    const double end = torsion;
    for (int k = 1; k <= 500; ++k) move(end * (1 - k / 500.0));
    // The trapezoid is off by its third order: 1e-3 of what goes to and fro at most.
    CHECK(least > -1e-3 * most);
    if (loops) {
      CHECK(work > 0.5 * most);
    } else {
      CHECK(std::abs(work) < 1e-2 * most);
    }
  }
}

TEST_CASE("where the loop turns, the torque does not jump") {
  const Gearing<double> model = gearing<double>();
  Gearing<double>::State state{};
  double torque = 0, before = 0;
  const double stiffest = 1 / coupling<double>.least_compliance;
  for (int k = 0; k <= 4000; ++k) {
    const double torsion = 0.2 * std::sin(k * 0.01);
    REQUIRE(coupling<double>.torque(model, {}, torsion, state, torque) == Status::ok);
    CHECK(std::abs(torque - before) <= 0.2 * 0.01 * stiffest * (1 + 1e-9));
    before = torque;
  }
}

TEST_CASE_TEMPLATE("what is not finite changes neither torque nor memory", S, float, double) {
  const Gearing<S> model = gearing<S>();
  typename Gearing<S>::State state{};
  S torque = 0;
  REQUIRE(coupling<S>.torque(model, {}, S(0.1L), state, torque) == Status::ok);
  const S last = torque;
  const auto memory = state_of<1>(state);
  for (const S bad : not_finite<S>) {
    CHECK(coupling<S>.torque(model, {}, bad, state, torque) == Status::not_finite);
  }
  CHECK(torque == last);
  CHECK(state_of<1>(state).load == memory.load);
  S lost = not_a_number<S>;
  CHECK(coupling<S>.torque(model, {}, S(0.1L), state, lost) == Status::not_finite);
  CHECK(torque == last);
}

TEST_CASE("finding takes some six evaluations, where it crosses the backlash too") {
  const Gearing<double> model = gearing<double>();
  const Counted counted{model};
  Gearing<double>::State state{};
  double torque = 0;
  int most = 0;
  for (int k = 0; k <= 100000; ++k) {
    const int before = counted.asked;
    const double torsion = 0.3 * std::sin(k * 6e-4) + 0.1 * std::sin(k * 0.0137);
    REQUIRE(coupling<double>.torque(counted, {}, torsion, state, torque) == Status::ok);
    most = std::max(most, counted.asked - before);
  }
  MESSAGE("evaluations: " << counted.asked / 1e5 << " on average, " << most << " at most");
  CHECK(counted.asked < 8 * 100001);
  CHECK(most < 16);
}
