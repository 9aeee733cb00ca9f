#include <doctest/doctest.h>

#include "estimator_cases.hpp"
#include "flexspline/estimators/compliance.hpp"

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
