#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "flexspline/estimators/load_hysteresis.hpp"

using namespace flexspline;

namespace {

constexpr double half_pi = 1.5707963267948966;

/// Table III of full_range_torque_estimation, set c1.
template <typename S>
constexpr Compliance<S> paper{S(15548), S(0.0487L), S(0.05L)};

template <typename S>
FlaggedTorque<S> torque_of(S torsion, const Compliance<S>& made = paper<S>) {
  FlaggedTorque<S> out;
  REQUIRE(made.torque(torsion, out) == Status::ok);
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("torsion of a torque gives the torque back", S, float, double) {
  for (const S shape : {S(0), S(1e-4), S(0.0487L)}) {
    const Compliance<S> made{S(15548), shape, S(0.01L)};
    for (S torque = -200; torque <= S(200); torque += S(0.5)) {
      const S torsion = mesh_torsion(torque, made.mesh_stiffness, made.mesh_shape);
      const auto back = torque_of(torsion, made);
      // rounding of the torsion, over the slope of atan there
      const double bent = static_cast<double>(shape * torque);
      const double bound = rounding<S>(6) * (1 + bent * bent);
      CHECK(static_cast<double>(back.torque) ==
            doctest::Approx(static_cast<double>(torque)).epsilon(bound));
      CHECK(back.flags == Flag::none);
    }
  }
}

TEST_CASE_TEMPLATE("torsion agrees with (15) and has the other sign than the torque", S, float,
                   double) {
  for (double torque = -80; torque <= 80; torque += 0.7) {
    const double printed = std::atan(0.0487 * torque) / (0.0487 * 15548);
    CHECK(static_cast<double>(mesh_torsion(S(torque), S(15548), S(0.0487L))) ==
          doctest::Approx(-printed).epsilon(rounding<S>(8)));
  }
}

TEST_CASE_TEMPLATE("past the pole a torque is held, flagged, finite and of the right sign", S,
                   float, double) {
  const double pole = half_pi / (0.0487 * 15548);
  CHECK(pole == doctest::Approx(2.07e-3).epsilon(0.003));  // as the reading guide has it
  const S edge = torque_of(S(-0.9501 * pole)).torque;
  CHECK(static_cast<double>(edge) ==
        doctest::Approx(std::tan(0.95 * half_pi) / 0.0487).epsilon(rounding<S>(200)));
  for (const double share : {0.951, 0.99, 1.0, 1.01, 1.5, 2.0, 3.7, 1e6, 1e30}) {
    for (const double sign : {-1.0, 1.0}) {
      const auto found = torque_of(S(-sign * share * pole));
      CHECK(found.flags == Flag::saturated);
      CHECK(found.torque == S(sign) * edge);
    }
  }
  CHECK(torque_of(S(-0.949 * pole)).flags == Flag::none);
  CHECK(torque_of(S(-0.949 * pole)).torque < edge);
}

TEST_CASE_TEMPLATE("the torque rises with minus the torsion through the edge of the model", S,
                   float, double) {
  S last = -std::numeric_limits<S>::max();
  for (int i = -300; i <= 300; ++i) {
    const S torque = torque_of(S(-1e-5 * i)).torque;
    CHECK(torque >= last);
    last = torque;
  }
}

TEST_CASE_TEMPLATE("a torsion that is not finite leaves the torque alone", S, float, double) {
  FlaggedTorque<S> out{S(7), Flag::extrapolated};
  for (const S bad : not_finite<S>) CHECK(paper<S>.torque(bad, out) == Status::not_finite);
  CHECK(out.torque == S(7));
  CHECK(out.flags == Flag::extrapolated);
}

TEST_CASE_TEMPLATE("the wave generator runs out of way at its lost motion", S, float, double) {
  const double most = 1 / (3.125 * 21.9931);
  for (double torque = -4; torque <= 4; torque += 0.01) {
    const auto found = static_cast<double>(wave_generator_torsion(S(torque), S(21.9931), S(3.125)));
    const double printed = std::copysign(most * -std::expm1(-3.125 * std::abs(torque)), torque);
    CHECK(std::abs(found + printed) <= rounding<S>(8) * most);
  }
  CHECK(wave_generator_torsion(S(0), S(21.9931), S(3.125)) == S(0));
  CHECK(static_cast<double>(wave_generator_torsion(S(1e9), S(21.9931), S(3.125))) ==
        doctest::Approx(-most).epsilon(rounding<S>(4)));
  CHECK(wave_generator_torsion(S(2), S(4), S(0)) == S(-0.5));
}

TEST_CASE_TEMPLATE("twisting either spring stores energy", S, float, double) {
  double mesh = 0, generator = 0, last_mesh = 0, last_generator = 0;
  for (int i = 0; i <= 1000; ++i) {  // −∫ τ dΔθ along a negative torque
    const S torque = S(-0.1 * i);
    const auto twist = static_cast<double>(mesh_torsion(torque, S(15548), S(0.0487L)));
    const auto wave = static_cast<double>(wave_generator_torsion(torque, S(21.9931), S(3.125)));
    mesh -= static_cast<double>(torque) * (twist - last_mesh);
    generator -= static_cast<double>(torque) * (wave - last_generator);
    last_mesh = twist;
    last_generator = wave;
  }
  CHECK(mesh > 0);
  CHECK(generator > 0);
}

namespace {

/// ρ = K Σ c_k / w_k = 15548 · (0.5 + 2 · 0.5 + 4 · 0.25 + 8 · 0.125) · 1e-5 / 2 = 0.27 at no load.
template <typename S>
constexpr LoadHysteresis<S> loop{S(2), {S(5e-6L), S(5e-6L), S(2.5e-6L), S(1.25e-6L)}};

/// The torsion of a gear whose load goes this way, and the largest error of the torque that is
/// found, Nm.
template <typename S>
struct Track {
  typename MaxwellSlip<S, 4>::State springs;
  typename LoadHysteresis<S>::State state;
  Compliance<S> mesh{S(15548), S(0), S(0.05L)};
  S last = 0;
  double worst = 0;

  void to(S torque) {
    using Springs = MaxwellSlip<S, 4>;
    const S place = Springs::on_grid(torque, loop<S>.load_width);
    Springs::step(springs, place - last, loop<S>.load_width);
    last = place;
    const S bent = weighted<S>(Springs::shares(springs, loop<S>.load_width), loop<S>.heights);
    const S torsion = mesh_torsion(torque, mesh.mesh_stiffness, mesh.mesh_shape) + bent;
    S left = 0;
    FlaggedTorque<S> out;
    REQUIRE(loop<S>.torque(mesh, state, torsion, left, out) == Status::ok);
    CHECK(math::absolute(left * mesh.mesh_stiffness + out.torque) <= rounding<S>(8) * 20);
    worst = std::max(worst, static_cast<double>(math::absolute(out.torque - torque)));
  }
};

template <typename S>
double worst_of(int samples) {
  Track<S> way;
  for (int i = 0; i <= samples; ++i) {
    const double turn = 40.0 * i / samples;
    way.to(S(8 * std::sin(turn) + 3 * std::sin(2.7 * turn)));
  }
  return way.worst;
}

}  // namespace

TEST_CASE_TEMPLATE("a loop on the path of the load is taken off to the square of its share", S,
                   float, double) {
  // Of a step Δτ, ρ² / (1 − ρ²) is left; where the load turned with that error, the springs keep
  // it times ρ / (1 − ρ) until they slip.
  const double rho = 0.273;
  const double left = rho * rho / (1 - rho * rho) / (1 - rho);
  const double steepest = 40.0 * (8 + 3 * 2.7);
  for (const int samples : {1000, 4000, 16000}) {
    const double rounded = 16 * static_cast<double>(rounding<S>(8)) * 11;
    CHECK(worst_of<S>(samples) <= left * steepest / samples + rounded);
  }
  CHECK(worst_of<double>(16000) < 0.3 * worst_of<double>(4000));
}

TEST_CASE_TEMPLATE("a torque that is held and a torsion that is none leave the springs", S, float,
                   double) {
  Track<S> straight, broken;
  for (int i = 0; i < 300; ++i) {
    const S torque = S(6 * std::sin(0.1 * i));
    straight.to(torque);
    broken.to(torque);
    S left = 0;
    FlaggedTorque<S> out;
    Compliance<S> stiffening = broken.mesh;
    stiffening.mesh_shape = S(0.0487L);
    for (const S far : {S(0.1L), S(-0.1L)}) {
      REQUIRE(loop<S>.torque(stiffening, broken.state, far, left, out) == Status::ok);
      CHECK(out.flags == Flag::saturated);
      CHECK((out.torque < S(0)) == (far > S(0)));
    }
    for (const S bad : not_finite<S>) {
      CHECK(loop<S>.torque(broken.mesh, broken.state, bad, left, out) == Status::not_finite);
    }
  }
  CHECK(same_bits(straight.state.torque, broken.state.torque));
  CHECK(same_bits(straight.state.loop, broken.state.loop));
}

TEST_CASE_TEMPLATE("a loop that no gear has leaves the torque bounded", S, float, double) {
  const LoadHysteresis<S> wild{S(0.1L), {S(1e-3L), S(-2e-3L), S(1e-3L), S(3e-3L)}};
  const Compliance<S> mesh{S(15548), S(0), S(0.05L)};
  typename LoadHysteresis<S>::State state;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> torsion(-2e-3, 2e-3);
  for (int i = 0; i < 5000; ++i) {
    S left = 0;
    FlaggedTorque<S> out;
    REQUIRE(wild.torque(mesh, state, S(torsion(random)), left, out) == Status::ok);
    CHECK(math::absolute(out.torque) <= S(15548 * 9.001e-3));
  }
}
