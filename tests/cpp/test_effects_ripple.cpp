#include <doctest/doctest.h>

#include <complex>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

template <typename S>
SpeedDependentRipple<S, 2> resonant() {
  SpeedDependentRipple<S, 2> effect{{{{{1, Pair::motor_on_stator}, {4, Pair::motor_on_stator}}}}};
  effect.resonance_velocity = S(2);
  effect.damping_ratio = S(0.1);
  return effect;
}

}  // namespace

TEST_CASE_TEMPLATE(
    "modulated ripple is what an oscillator adds to what drives it, in both directions", S, float,
    double) {
  const auto effect = resonant<S>();
  std::mt19937_64 random(40);
  for (int i = 0; i < 500; ++i) {
    auto at = usual_sample<S>(random);
    const auto row = effect.row(at);
    for (std::size_t k = 0; k < 2; ++k) {
      const auto p =
          (math::Bits<S>(effect.harmonics()[k].order) * at.motor_position.phase).phasor();
      const double rho = effect.harmonics()[k].order * double(at.output_velocity) / 2.0;
      const std::complex<double> response =
          1.0 / std::complex<double>(1 - rho * rho, 0.2 * rho) - 1.0;
      const std::complex<double> wave = response * std::complex<double>(p.cosine, p.sine);
      // near the resonance a rounding of ρ² is multiplied by up to 1/(2ζ)²
      const double bound = sizeof(S) == 4 ? 2e-5 : 1e-13;
      CHECK(std::abs(double(row[2 * k]) - wave.real()) <= bound);
      CHECK(std::abs(double(row[2 * k + 1]) - wave.imag()) <= bound);
    }
  }
}

TEST_CASE_TEMPLATE("modulated ripple is nothing at rest and takes the ripple away far above", S,
                   float, double) {
  const auto effect = resonant<S>();
  std::mt19937_64 random(41);
  auto at = usual_sample<S>(random);
  at.output_velocity = S(0);
  for (const S value : effect.row(at)) CHECK(value == S(0));
  for (const S v : {S(1e6), S(-1e30)}) {
    at.output_velocity = v;
    const auto row = effect.row(at);
    const auto plain = Harmonics<S, 2>(effect).row(at);
    for (std::size_t k = 0; k < 4; ++k) CHECK(std::abs(row[k] + plain[k]) <= S(3e-4));
  }
}
