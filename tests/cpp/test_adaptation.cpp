#include <doctest/doctest.h>

#include <cstring>
#include <random>

#include "estimator_cases.hpp"
#include "flexspline/estimators/adaptation.hpp"

using namespace flexspline;

namespace {

template <typename S, std::size_t N = 2>
struct Rig {
  using Its = Adaptation<S, N>;
  using Numbers = typename Its::Numbers;
  typename Its::Config config;
  typename Its::State state;
  Numbers model{};

  /// The joint pushes `torque` more than the model knows of; a block is a period.
  Status feed(const Numbers& row, S torque, S velocity = S(1), bool clean = true) {
    return Its::advance(config, state, model,
                        {config.interval, torque, S(0), velocity, clean, row});
  }
  double value(std::size_t k) const {
    return static_cast<double>(Its::coefficients(state, model)[k]);
  }
};

/// Coulomb's and viscous friction, 5 Nm and 8 Nm s/rad, each known to a tenth.
template <typename S, std::size_t N = 2>
Rig<S, N> friction() {
  Rig<S, N> rig;
  rig.config.noise = S(0.25);
  rig.config.interval = S(0.125);
  rig.config.memory = S(100);
  rig.config.least_speed = S(0.05);
  rig.model[0] = S(5);
  rig.model[1] = S(8);
  rig.config.low[0] = S(2.5);
  rig.config.high[0] = S(10);
  rig.config.low[1] = S(4);
  rig.config.high[1] = S(16);
  rig.config.factor[0] = S(0.25);
  rig.config.factor[2] = S(0.64);
  return rig;
}

template <typename T>
bool same_bytes(const T& a, const T& b) {
  return std::memcmp(static_cast<const void*>(&a), static_cast<const void*>(&b), sizeof a) == 0;
}

/// Rows of friction at random speeds of either sign.
struct Motion {
  std::mt19937 random{7};
  std::uniform_real_distribution<double> speed{0.1, 1.0};
  std::normal_distribution<double> noise{0.0, 1.0};

  double next() { return (random() & 1U) != 0 ? speed(random) : -speed(random); }
};

template <typename S, std::size_t N>
std::array<S, N> row_at(double v) {
  std::array<S, N> row{};
  row[0] = v < 0 ? S(-1) : S(1);
  row[1] = S(v);
  return row;
}

/// The same of rounds, on the information matrix itself, in double.
struct Reference {
  double r00, r01 = 0, r11, a = 0, b = 0;
  double w00 = 0, w01 = 0, w11 = 0, s0 = 0, s1 = 0;

  void teach(double h0, double h1, double error) {
    const double e = error - h0 * a - h1 * b;
    w00 += h0 * h0, w01 += h0 * h1, w11 += h1 * h1;
    s0 += h0 * e, s1 += h1 * e;
  }
  void finish(double left) {
    r00 = left * r00 + w00, r01 = left * r01 + w01, r11 = left * r11 + w11;
    const double det = r00 * r11 - r01 * r01;
    a += (r11 * s0 - r01 * s1) / det;
    b += (r00 * s1 - r01 * s0) / det;
    w00 = w01 = w11 = s0 = s1 = 0;
  }
};

}  // namespace

TEST_CASE("where all is excited it is least squares with exponential forgetting") {
  auto rig = friction<double>();
  rig.config.gate = 1e6;
  rig.config.low = {-1e3, -1e3};
  rig.config.high = {1e3, 1e3};
  Reference plain{1 / 0.25, 0, 1 / 0.64};
  Motion motion;
  std::array<double, 2> before{}, waiting{};
  double y_before = 0, y_waiting = 0, time = 0;
  for (int k = 0; k < 20'000; ++k) {
    const auto row = row_at<double, 2>(motion.next());
    const double y = 1.2 * row[0] - 0.7 * row[1] + 0.25 * motion.noise(motion.random);
    REQUIRE(rig.feed(row, y) == Status::ok);
    if (k >= 2) {  // a block's mean by trapezoids, a block late
      plain.teach(waiting[0] / 0.25, waiting[1] / 0.25, y_waiting / 0.25);
      time += 0.125;
      if (time >= 12.5) {
        plain.finish(std::exp(-time / 100));
        time = 0;
        REQUIRE(rig.state.moved[0] == doctest::Approx(plain.a).epsilon(1e-9));
        REQUIRE(rig.state.moved[1] == doctest::Approx(plain.b).epsilon(1e-9));
      }
    }
    waiting = {0.5 * (before[0] + row[0]), 0.5 * (before[1] + row[1])};
    y_waiting = 0.5 * (y_before + y);
    before = row;
    y_before = y;
  }
  CHECK(rig.state.moved[0] == doctest::Approx(1.2).epsilon(0.05));
  CHECK(rig.state.told == 2);
  const double det = plain.r00 * plain.r11 - plain.r01 * plain.r01;
  CHECK(rig.state.factor[2] == doctest::Approx(plain.r00 / det).epsilon(1e-9));
  CHECK(rig.state.factor[1] * rig.state.factor[2] ==
        doctest::Approx(-plain.r01 / det).epsilon(1e-9));
}

TEST_CASE_TEMPLATE("a joint that stands changes nothing, however long", S, float, double) {
  auto rig = friction<S>();
  Motion motion;
  for (int k = 0; k < 1000; ++k) {
    REQUIRE(rig.feed(row_at<S, 2>(motion.next()), S(0.1)) == Status::ok);
  }
  REQUIRE(rig.feed(row_at<S, 2>(0.0), S(0), S(0)) == Status::ok);
  const auto learned = rig.state;
  for (int k = 0; k < 10'000'000; ++k) {  // two weeks of blocks; noise alone in speed and torque
    const double noise = 1e-3 * (k % 21 - 10);
    (void)rig.feed(row_at<S, 2>(noise), S(4 * noise), S(noise));
  }
  CHECK(same_bytes(rig.state, learned));
}

TEST_CASE_TEMPLATE("one direction alone, however long, leaves the other as it was", S, float,
                   double) {
  auto rig = friction<S>();
  Motion motion;
  const auto row = row_at<S, 2>(0.5);
  for (int k = 0; k < 10'000'000; ++k) {
    const double seen = 0.6 + 0.25 * static_cast<double>(k * 719LL % 2001 - 1000) / 1000.0;
    (void)rig.feed(row, S(seen));
  }
  // (0.5, −1) is across the row: what R says of it is what it said at the start.
  const double u = rig.state.factor[1];
  const double d0 = rig.state.factor[0], d1 = rig.state.factor[2];
  const double r00 = 1 / d0, r01 = -u / d0, r11 = 1 / d1 + u * u / d0;
  const double across = 0.25 * r00 - 2 * 0.5 * r01 + r11;
  CHECK(across == doctest::Approx(0.25 / 0.25 + 1 / 0.64).epsilon(rounding<S>(4e4)));
  // ζ of a row goes to (1 − λ) / 100 of a round of 100 blocks, with the last one in it.
  const double zeta = 16 * ((d0 + u * u * d1) + 2 * 0.5 * u * d1 + 0.25 * d1);
  CHECK(zeta == doctest::Approx(-math::expm1_negative(0.125) / 100).epsilon(1e-3));
  const double said = (rig.value(0) - 5) + 0.5 * (rig.value(1) - 8);
  CHECK(said == doctest::Approx(0.6).epsilon(0.02));
  CHECK(rig.state.told == 1);
  CHECK(std::abs(rig.value(0) - 5) < 0.6);
  CHECK(std::abs(rig.value(1) - 8) < 0.6);
}

TEST_CASE_TEMPLATE("what two of four directions say leaves the other two as they were", S, float,
                   double) {
  using Its = Adaptation<S, 4>;
  Rig<S, 4> rig;
  rig.config.noise = S(0.25);
  rig.config.interval = S(0.125);
  rig.config.memory = S(100);
  constexpr std::array variance{0.3, 0.02, 1.5, 0.1};
  for (std::size_t k = 0; k < 4; ++k) {
    rig.config.low[k] = S(-4);
    rig.config.high[k] = S(4);
    rig.config.factor[k * (k + 3) / 2] = S(variance[k]);
  }
  Motion motion;
  for (int k = 0; k < 1'000'000; ++k) {
    const double a = motion.next(), b = motion.next();  // rows of (1, 2, 0, 1) and (0, 1, 1, −1)
    const double y = 0.3 * a - 0.2 * b + 0.25 * motion.noise(motion.random);
    (void)rig.feed({S(a), S(2 * a + b), S(b), S(a - b)}, S(y));
  }
  const auto times = [&](const std::array<double, 4>& x) {  // P x = U D Uᵀ x
    std::array<double, 4> inner{}, outer{};
    const auto u = [&](std::size_t j, std::size_t k) {
      return j == k ? 1.0 : static_cast<double>(rig.state.factor[k * (k + 1) / 2 + j]);
    };
    for (std::size_t k = 0; k < 4; ++k) {
      for (std::size_t j = 0; j <= k; ++j) inner[k] += u(j, k) * x[j];
      inner[k] *= static_cast<double>(rig.state.factor[k * (k + 3) / 2]);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      for (std::size_t k = j; k < 4; ++k) outer[j] += u(j, k) * inner[k];
    }
    return outer;
  };
  for (const std::array<double, 4> n : {std::array{-1.0, 0.0, 1.0, 1.0}, {-3.0, 1.0, 0.0, 1.0}}) {
    std::array<double, 4> weighted_n{};  // R n of the start
    double across = 0, size = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      weighted_n[k] = n[k] / variance[k];
      across += weighted_n[k] * static_cast<double>(rig.state.moved[k]);
      size += std::abs(weighted_n[k] * static_cast<double>(rig.state.moved[k]));
    }
    const auto again = times(weighted_n);
    for (std::size_t k = 0; k < 4; ++k) CHECK(std::abs(again[k] - n[k]) < rounding<S>(1e4));
    CHECK(std::abs(across) < rounding<S>(1e4) * size);
  }
  const auto now = Its::coefficients(rig.state, rig.model);
  const double first = double(now[0]) + 2 * double(now[1]) + double(now[3]);
  const double second = double(now[1]) + double(now[2]) - double(now[3]);
  CHECK(first == doctest::Approx(0.3).epsilon(0.2));
  CHECK(second == doctest::Approx(-0.2).epsilon(0.2));
  CHECK(rig.state.told == 2);
}

TEST_CASE_TEMPLATE("ten million blocks do not make it drift", S, float, double) {
  auto rig = friction<S>();
  Motion motion;
  double worst = 0;
  for (int k = 0; k < 10'000'000; ++k) {
    const auto row = row_at<S, 2>(motion.next());
    const double y =
        1.0 * double(row[0]) + 1.6 * double(row[1]) + 0.25 * motion.noise(motion.random);
    (void)rig.feed(row, S(y));
    if (k > 100'000) worst = std::max(worst, std::abs(rig.value(0) - 6.0));
  }
  // Of 800 blocks in a memory, twice as many in effect: with rows of means of two (½ E v² = 0.185,
  // correlation 0.904) a standard error of 0.25 / √(1600 · 0.5 · (1 − 0.82)) = 0.021 Nm. Ten
  // million blocks hold 1e4 memories, of which the worst is at 4.5 of it.
  CHECK(worst < 4.5 * 0.021);
  CHECK(rig.value(0) == doctest::Approx(6.0).epsilon(0.02));
  CHECK(rig.value(1) == doctest::Approx(9.6).epsilon(0.02));
}

TEST_CASE("float follows double with a memory of days") {
  auto narrow = friction<float>();
  auto wide = friction<double>();
  narrow.config.memory = 1e5F;
  wide.config.memory = 1e5;
  Motion motion;
  for (int k = 0; k < 3'000'000; ++k) {
    const double v = motion.next();
    const double y = 1e-6 * k * (v < 0 ? -1 : 1) / 3 + 0.25 * motion.noise(motion.random);
    (void)narrow.feed(row_at<float, 2>(v), float(y));
    (void)wide.feed(row_at<double, 2>(v), y);
  }
  CHECK(narrow.value(0) == doctest::Approx(wide.value(0)).epsilon(2e-3));
  CHECK(narrow.value(1) == doctest::Approx(wide.value(1)).epsilon(2e-3));
  CHECK(wide.value(0) > 5.5);
}

TEST_CASE_TEMPLATE("what is no number leaves the state as it was", S, float, double) {
  auto rig = friction<S>();
  Motion motion;
  for (int k = 0; k < 100; ++k) (void)rig.feed(row_at<S, 2>(motion.next()), S(0.1));
  const auto before = rig.state;
  for (const S wrong : not_finite<S>) {
    CHECK(rig.feed({S(1), S(1)}, wrong) == Status::not_finite);
    CHECK(rig.feed({wrong, S(1)}, S(0)) == Status::not_finite);
    CHECK(rig.feed({S(1), wrong}, S(0)) == Status::not_finite);
    CHECK(rig.feed({S(1), S(1)}, S(0), wrong) == Status::not_finite);
    CHECK(Adaptation<S, 2>::step(rig.config, rig.state, rig.model,
                                 {S(0.1), S(0), wrong, S(1), true, {S(1), S(1)}}) ==
          Status::not_finite);
  }
  for (const S period : bad_periods<S>) {
    CHECK(Adaptation<S, 2>::step(rig.config, rig.state, rig.model,
                                 {period, S(0), S(0), S(1), true, {S(1), S(1)}}) ==
          Status::bad_period);
  }
  CHECK(same_bytes(rig.state, before));
}

TEST_CASE_TEMPLATE("a contact teaches nothing, nor does the block that it may have begun in", S,
                   float, double) {
  auto rig = friction<S>();
  rig.config.gate = S(100);
  for (int k = 0; k < 10; ++k) (void)rig.feed({S(1), S(0.5)}, S(0));
  (void)rig.feed({S(1), S(0.5)}, S(3));  // the push, not yet detected
  const auto before = rig.state;
  CHECK(before.said == std::array{S(0), S(0)});
  for (int k = 0; k < 10; ++k) {
    CHECK(rig.feed({S(1), S(0.5)}, S(3), S(1), false) == Status::ok);
  }
  (void)rig.feed({S(1), S(0.5)}, S(0));
  CHECK(rig.state.said == before.said);
  CHECK(rig.state.seen == before.seen);
  CHECK(rig.state.taught == before.taught);
  for (int k = 0; k < 100; ++k) (void)rig.feed({S(1), S(0.5)}, S(0.5));
  CHECK(rig.state.moved != before.moved);
}

TEST_CASE_TEMPLATE("what is beyond the gate is refused and counted", S, float, double) {
  auto rig = friction<S>();
  for (int k = 0; k < 4000; ++k) {
    (void)rig.feed(row_at<S, 2>(k % 80 < 40 ? 0.3 : 0.9), S(0));
  }
  (void)rig.feed({S(1), S(0.6)}, S(0), S(1), false);
  const auto before = rig.state;
  for (int k = 0; k < 100; ++k) (void)rig.feed({S(1), S(0.6)}, S(1.5));
  CHECK(rig.state.refused >= 98);
  CHECK(rig.state.moved == before.moved);
  for (int k = 0; k < 100; ++k) (void)rig.feed({S(1), S(0.6)}, S(0.5));
  CHECK(rig.state.refused <= 101);
  CHECK(rig.state.moved != before.moved);
}

TEST_CASE_TEMPLATE("coefficients stay in their ranges, the others as least squares has them", S,
                   float, double) {
  auto rig = friction<S>();
  rig.config.gate = S(1000);
  Motion motion;
  bool inside = true;
  for (int k = 0; k < 20000; ++k) {
    const auto row = row_at<S, 2>(motion.next());
    (void)rig.feed(row, S(-4) * row[0] + S(1) * row[1]);
    for (std::size_t i = 0; i < 2; ++i) {
      inside &= rig.value(i) >= double(rig.config.low[i]) * (1 - rounding<S>(2));
      inside &= rig.value(i) <= double(rig.config.high[i]) * (1 + rounding<S>(2));
    }
  }
  CHECK(inside);
  CHECK(rig.value(0) == doctest::Approx(2.5));
  // Held at θ_0 = −2.5, least squares of −4 sgn v + v has θ_1 = 1 − 1.5 E|v| / E v² = −1.23, speeds
  // between 0.1 and 1; within what 800 random ones leave of it.
  CHECK(rig.value(1) == doctest::Approx(8.0 - 1.23).epsilon(0.02));
}

TEST_CASE_TEMPLATE("a coefficient whose range is empty is not adapted", S, float, double) {
  auto rig = friction<S>();
  rig.config.low[1] = rig.config.high[1] = S(8);
  rig.config.factor[1] = S(3);
  Motion motion;
  for (int k = 0; k < 1000; ++k) {
    const auto row = row_at<S, 2>(motion.next());
    (void)rig.feed(row, S(0.7) * row[0]);
  }
  CHECK(rig.state.moved[1] == S(0));
  CHECK(rig.value(0) == doctest::Approx(5.7).epsilon(0.01));
}

TEST_CASE_TEMPLATE("room for more coefficients changes no bit", S, float, double) {
  auto few = friction<S, 2>();
  auto many = friction<S, 8>();
  Motion motion;
  for (int k = 0; k < 5000; ++k) {
    const double v = motion.next();
    const S y = S(0.3 * motion.noise(motion.random) + 0.8 * v);
    auto wide = row_at<S, 8>(v);
    for (std::size_t i = 2; i < 8; ++i) wide[i] = S(v);  // of effects that are not adapted
    REQUIRE(few.feed(row_at<S, 2>(v), y) == Status::ok);
    REQUIRE(many.feed(wide, y) == Status::ok);
    for (std::size_t i = 0; i < 2; ++i) {
      CHECK(same_bits(few.state.moved[i], many.state.moved[i]));
    }
    for (std::size_t i = 0; i < 3; ++i) {
      CHECK(same_bits(few.state.factor[i], many.state.factor[i]));
    }
  }
}

TEST_CASE_TEMPLATE("other coefficients in the model begin anew, the same go on", S, float, double) {
  auto rig = friction<S>();
  Motion motion;
  for (int k = 0; k < 1000; ++k) {
    const auto row = row_at<S, 2>(motion.next());
    (void)rig.feed(row, row[0]);
  }
  const double learned = rig.value(0);
  CHECK(learned == doctest::Approx(6).epsilon(0.01));
  rig.model[0] = S(4);
  CHECK(rig.value(0) == 4.0);
  (void)rig.feed({S(1), S(0.5)}, S(0));
  CHECK(rig.value(0) == 4.0);
  CHECK(rig.state.factor == rig.config.factor);
  CHECK(rig.state.taught == 0);
}

TEST_CASE_TEMPLATE("a block's torque is what drove the momentum in it", S, float, double) {
  auto rig = friction<S>();
  rig.config.interval = S(0.5);
  for (int k = 0; k <= 8; ++k) {  // τ̄ grows by 1 Nm/s, as does 0.3 t² + 2 Nm s of momentum
    const S t = S(0.125) * S(k);
    CHECK(Adaptation<S, 2>::step(rig.config, rig.state, rig.model,
                                 {S(0.125), t, S(0.3) * t * t + S(2), S(1), true, {S(1), t}}) ==
          Status::ok);
  }
  // Of the second block, 0.5 s to 1 s: mean 0.75 less 0.3 (1 − 0.25) / 0.5
  CHECK(static_cast<double>(rig.state.waiting.torque) ==
        doctest::Approx(0.75 - 0.45).epsilon(rounding<S>(40)));
  CHECK(static_cast<double>(rig.state.waiting.row[1]) == doctest::Approx(0.75));
}

TEST_CASE_TEMPLATE("whatever bits it is given, it stays finite and in its ranges", S, float,
                   double) {
  std::mt19937_64 random(3);
  using Its = Adaptation<S, 3>;
  for (int run = 0; run < 3000; ++run) {
    const auto any = [&] {
      const bool wild = random() % 8 == 0;
      const auto bits = static_cast<math::Bits<S>>(random());
      return wild ? std::bit_cast<S>(bits) : S(static_cast<double>(random() % 2001) / 500.0 - 2.0);
    };
    const auto finite_one = [&] {
      const S one = any();
      return math::is_finite(one) ? one : S(1);
    };
    typename Its::Config config;
    config.noise = math::absolute(finite_one()) + S(1e-3);
    config.memory = math::absolute(finite_one()) + S(1e-3);
    config.gate = S(1e6);
    config.interval = S(0.01);
    typename Its::Numbers model{};
    for (std::size_t k = 0; k < 3; ++k) {
      config.low[k] = finite_one();
      config.high[k] = finite_one();
      model[k] = finite_one();
    }
    for (S& each : config.factor) each = finite_one();
    typename Its::State state;
    for (int k = 0; k < 50; ++k) {
      typename Its::Input in{S(0.01), any(), any(), any(), random() % 16 != 0, {}};
      for (S& each : in.row) each = any();
      const Status status = Its::step(config, state, model, in);
      bool good = status == Status::ok || status == Status::not_finite;
      for (std::size_t i = 0; i < 3; ++i) {
        const S moved = state.moved[i];
        const bool inside =
            moved == S(0) || !(config.low[i] < config.high[i]) ||
            (moved >= config.low[i] - model[i] && moved <= config.high[i] - model[i]);
        good &= math::is_finite(moved) && inside;
      }
      REQUIRE(good);
    }
  }
}
