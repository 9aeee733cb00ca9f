#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "flexspline/estimators/order_tracker.hpp"
#include "flexspline/estimators/ripple_oscillator.hpp"
#include "flexspline/sensor/bridge.hpp"
#include "flexspline/sensor/electronics.hpp"

using namespace flexspline;

namespace {

constexpr double tau = 6.283185307179586;

/// Pairs of gauges, one on each flank of the spokes at these quarters of a turn.
template <typename S>
Bridge<S, 8> pairs_at(std::initializer_list<int> quarters) {
  Bridge<S, 8> bridge;
  bridge.count = 0;
  for (const int quarter : quarters) {
    for (const S sign : {S(1), S(-1)}) {
      auto& gauge = bridge.gauges[bridge.count++];
      gauge.angle = Angle<S>::from_turns(S(quarter) / 4).phase;
      gauge.sign = gauge.arm = sign;
    }
  }
  return bridge;
}

template <typename S>
WaveStrain<S> bending(std::uint32_t order) {
  return {order, {S(3e-6), S(-4e-6)}, {S(0), S(0)}};
}

template <typename S>
S size(const math::Phasor<S>& p) {
  return std::hypot(p.cosine, p.sine);
}

}  // namespace

TEST_CASE_TEMPLATE("a full bridge gives K times strain times supply: (5)", S, float, double) {
  for (const auto& bridge : {pairs_at<S>({0, 1}), pairs_at<S>({0, 1, 2, 3})}) {
    std::array<S, 8> strain{};
    for (std::size_t i = 0; i < bridge.count; ++i) {
      strain[i] = mechanical_strain<S>(bridge.gauges[i], S(8e-4), nullptr, 0, {});
    }
    CHECK(bridge.voltage(strain.data()) == doctest::Approx(2 * 8e-4 * 3.3).epsilon(1e-6));
    CHECK(bridge.torque_gain() == S(1));
  }
}

TEST_CASE_TEMPLATE("pairs at 0° and 90° cancel order 2 and not order 1", S, float, double) {
  const auto bridge = pairs_at<S>({0, 1});
  const S exact = sizeof(S) == 4 ? S(1e-12) : S(1e-20);
  CHECK(size(bridge.ripple(bending<S>(2))) < exact);
  CHECK(size(bridge.ripple(bending<S>(1))) == doctest::Approx(5e-6 * std::sqrt(0.5)).epsilon(1e-6));
  CHECK(size(bridge.ripple(bending<S>(4))) == doctest::Approx(5e-6).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("four pairs a quarter apart keep multiples of four alone", S, float, double) {
  const auto bridge = pairs_at<S>({0, 1, 2, 3});
  for (std::uint32_t order = 1; order <= 12; ++order) {
    const S left = size(bridge.ripple(bending<S>(order)));
    if (order % 4 == 0) {
      CHECK(left == doctest::Approx(5e-6).epsilon(1e-6));
    } else {
      CHECK(left < (sizeof(S) == 4 ? S(1e-12) : S(1e-20)));
    }
  }
}

TEST_CASE_TEMPLATE("the ε_w of (1), alike in both gauges of a pair, leaves no sinusoid for (2)", S,
                   float, double) {
  const WaveStrain<S> wave{2, {S(0), S(0)}, {S(3e-6), S(4e-6)}};
  CHECK(size(pairs_at<S>({0}).ripple(wave)) == S(0));
  const WaveStrain<S> meant{2, {S(3e-6), S(4e-6)}, {S(0), S(0)}};
  CHECK(size(pairs_at<S>({0}).ripple(meant)) == doctest::Approx(5e-6).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("the ripple of a bridge is what its gauges' strains make over an angle", S,
                   float, double) {
  auto bridge = pairs_at<S>({0, 1, 3});
  bridge.gauges[1].angle = Angle<S>::from_turns(S(0.013)).phase;
  bridge.gauges[4].sensitivity = S(0.97);
  const std::array<WaveStrain<S>, 2> waves{
      {{1, {S(2e-6), S(1e-6)}, {S(5e-6), S(0)}}, {3, {S(-1e-6), S(4e-6)}, {S(0), S(3e-6)}}}};
  for (int i = 0; i < 50; ++i) {
    const auto beta = Angle<S>::from_turns(S(i) / 50).phase;
    std::array<S, 8> strain{};
    for (std::size_t g = 0; g < bridge.count; ++g) {
      strain[g] = mechanical_strain(bridge.gauges[g], S(0), waves.data(), waves.size(), beta);
    }
    S sum = 0;
    for (const auto& wave : waves) {
      sum += along(bridge.ripple(wave), (math::Bits<S>(wave.order) * beta).phasor());
    }
    const S volts = bridge.supply * bridge.gauge_factor;
    CHECK(std::abs(bridge.voltage(strain.data()) / volts - sum) < (sizeof(S) == 4 ? 1e-11 : 1e-19));
  }
}

TEST_CASE_TEMPLATE("gauges wired against their signs cancel the torque", S, float, double) {
  auto bridge = pairs_at<S>({0, 1});
  bridge.gauges[2].arm = S(-1);
  bridge.gauges[3].arm = S(1);
  CHECK(bridge.torque_gain() == S(0));
}

TEST_CASE_TEMPLATE("a gauge across the spoke reads minus Poisson's ratio", S, float, double) {
  CHECK(tilted(Phase<S>{}, S(0.33)) == S(1));
  CHECK(tilted(Angle<S>::from_turns(S(0.25)).phase, S(0.33)) == doctest::Approx(-0.33));
  CHECK(tilted(Angle<S>::from_turns(S(0.125)).phase, S(0.33)) == doctest::Approx(0.335));
}

TEST_CASE_TEMPLATE("a converter rounds to half a step and flags its ends", S, float, double) {
  using Chain = Conditioning<S>;
  const typename Chain::Config config;
  const S step = Chain::step_size(config);
  CHECK(step == S(5) / S(65536));
  for (int i = -400; i <= 400; ++i) {
    typename Chain::State state;
    S read = 0;
    Flag flags = Flag::saturated;
    const S input = S(i) * S(3.1e-5);
    CHECK(Chain::step(config, state, input, S(0), read, flags) == Status::ok);
    const bool inside = std::abs(200 * input) < S(2.4999);
    CHECK((flags == Flag::none) == inside);
    if (inside) CHECK(std::abs(read - 200 * input) <= step * S(0.501));
  }
}

TEST_CASE_TEMPLATE("the low pass is late by RC and starts where its input is", S, float, double) {
  using Chain = Conditioning<S>;
  typename Chain::Config config;
  config.time_constant = S(0.01);
  config.bits = 24;
  typename Chain::State state;
  S read = 0;
  Flag flags{};
  CHECK(Chain::step(config, state, S(0.001), S(0), read, flags) == Status::ok);
  CHECK(std::abs(read - S(0.2)) <= Chain::step_size(config));
  for (int i = 0; i < 10; ++i) {
    CHECK(Chain::step(config, state, S(0.002), S(0.001), read, flags) == Status::ok);
  }
  CHECK(read == doctest::Approx(0.2 + 0.2 * (1 - std::exp(-1.0))).epsilon(1e-5));
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const auto before = state.filtered;
  CHECK(Chain::step(config, state, nan, S(0.001), read, flags) == Status::not_finite);
  CHECK(Chain::step(config, state, S(0), S(0), read, flags) == Status::bad_period);
  CHECK(state.filtered == before);
}

TEST_CASE("thermal noise of 1 kΩ at 300 K is the textbook's 4.07 nV/√Hz") {
  CHECK(std::sqrt(noise::thermal_density(1000.0, 26.85)) == doctest::Approx(4.07e-9).epsilon(1e-3));
  CHECK(noise::bandwidth(1e-3) == doctest::Approx(tau / 4 / (tau * 1e-3)));
  CHECK(noise::rounding(1.0) == doctest::Approx(1.0 / 12));
  CHECK(std::sqrt(noise::of_capacitance(1e-12, 26.85)) == doctest::Approx(64.4e-6).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("the oscillator learns ripple in motion, at any speed, and holds it at rest", S,
                   float, double) {
  using Filter = RippleOscillator<S, 2>;
  typename Filter::Config config;
  config.orders = {1, 2};
  config.noise = S(0.01);
  typename Filter::State state;
  const auto ripple = [](double turns) {
    return 0.3 * std::cos(tau * turns + 0.4) + 0.5 * std::sin(2 * tau * turns);
  };
  double turns = 0, worst = 0, leaked = 0;
  for (int i = 0; i < 6000; ++i) {
    const bool moving = i < 4000;
    if (moving) turns += 0.004 + 0.003 * std::sin(i * 0.002);
    const double load = i < 5000 ? 1.0 : 3.0;
    S torque = 0;
    const auto angle = Angle<S>::from_turns(S(turns)).phase;
    REQUIRE(Filter::step(config, state, angle, S(load + ripple(turns)), S(1e-3), torque) ==
            Status::ok);
    auto& off = i < 5000 ? worst : leaked;
    if (i > 3000) off = std::fmax(off, std::abs(static_cast<double>(torque) - load));
  }
  CHECK(worst < 0.02);
  CHECK(leaked < 0.02);  // a change of load at rest goes into the level
  for (std::size_t k = 0; k < Filter::most; ++k) CHECK(state.covariance[k][k] >= S(0));
}

TEST_CASE("in float the oscillator stays with double over a million steps") {
  RippleOscillator<float, 2>::Config narrow;
  RippleOscillator<double, 2>::Config wide;
  narrow.orders = wide.orders = {1, 2};
  RippleOscillator<float, 2>::State a;
  RippleOscillator<double, 2>::State b;
  float low = 0;
  double high = 0;
  for (std::uint32_t i = 0; i < 1000000; ++i) {
    const Phase<float> angle{i * 17179869U};  // 1/250 turn
    const double reading = 0.4 * static_cast<double>((2U * angle).phasor().cosine);
    const auto same = Phase<double>{std::uint64_t(angle.fraction) << 32};
    REQUIRE(RippleOscillator<float, 2>::step(narrow, a, angle, static_cast<float>(reading), 1e-3f,
                                             low) == Status::ok);
    REQUIRE(RippleOscillator<double, 2>::step(wide, b, same, reading, 1e-3, high) == Status::ok);
  }
  CHECK(std::abs(static_cast<double>(low) - high) < 1e-4);
  for (std::size_t k = 0; k < 5; ++k) CHECK(a.covariance[k][k] > 0.0f);
}

TEST_CASE_TEMPLATE("a refused sample leaves the oscillator as it was", S, float, double) {
  using Filter = RippleOscillator<S, 1>;
  typename Filter::State state;
  S torque = 7;
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(Filter::step({{2}}, state, {}, nan, S(1e-3), torque) == Status::not_finite);
  CHECK_FALSE(state.started);
  CHECK(Filter::step({{2}}, state, {}, S(1), S(1e-3), torque) == Status::ok);
  CHECK(Filter::step({{2}}, state, {}, S(2), S(0), torque) == Status::bad_period);
  CHECK(torque == S(1));
  CHECK(state.mean[0] == S(1));
}

TEST_CASE_TEMPLATE("order tracking removes its orders after a turn, forward and back", S, float,
                   double) {
  using Filter = OrderTracker<S, 64>;
  const auto config = Filter::config_of(std::array<std::uint32_t, 2>{1, 2}, 2, 64);
  typename Filter::State state;
  const auto reading = [](double turns) {
    return 2 + 0.3 * std::cos(tau * turns + 0.4) + 0.5 * std::sin(2 * tau * turns);
  };
  double turns = 0.1, worst = 0;
  for (int i = 0; i < 2000; ++i) {
    turns += i < 1200 ? 0.003 : -0.003;
    S torque = 0;
    REQUIRE(Filter::step(config, state, Angle<S>::from_turns(S(turns)).phase, S(reading(turns)),
                         torque) == Status::ok);
    if (i < 300) CHECK(torque == S(reading(turns)));  // no whole turn yet
    if (i > 350) worst = std::fmax(worst, std::abs(static_cast<double>(torque) - 2));
  }
  CHECK(worst < 0.5 * std::pow(tau * 2 * 0.003, 2) / 8 * 3);  // linear between samples
}

TEST_CASE_TEMPLATE("order tracking sees no change of torque at standstill", S, float, double) {
  using Filter = OrderTracker<S, 32>;
  const auto config = Filter::config_of(std::array<std::uint32_t, 1>{2}, 1, 32);
  typename Filter::State state;
  S torque = 0;
  for (int i = 0; i < 300; ++i) {
    const auto angle = Angle<S>::from_turns(S(i) * S(0.01)).phase;
    REQUIRE(Filter::step(config, state, angle, S(1), torque) == Status::ok);
  }
  const auto rest = state.last;
  for (int i = 0; i < 100; ++i) {
    REQUIRE(Filter::step(config, state, rest, S(5), torque) == Status::ok);
  }
  CHECK(torque == doctest::Approx(1).epsilon(1e-5));
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(Filter::step(config, state, rest, nan, torque) == Status::not_finite);
  CHECK(state.reading == S(5));
}
