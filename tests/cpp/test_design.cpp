#include <doctest/doctest.h>

#include <limits>
#include <vector>

#include "host/accumulate.hpp"
#include "host/by_name.hpp"
#include "random_samples.hpp"

using namespace flexspline;

namespace {

constexpr std::size_t rows = 2300;  // two full blocks and a part of one
constexpr std::size_t gap = 1111;   // where a run begins anew

/// A log of random motion with all channels.
struct RandomLog {
  std::vector<double> q, v, a, theta, temperature, load, motor_torque, period, time;

  explicit RandomLog(unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    for (auto* column : {&q, &v, &a, &theta, &temperature, &load}) {
      for (std::size_t i = 0; i < rows; ++i) column->push_back(20 * normal(random));
    }
    for (double& speed : v) speed *= 0.001;
    for (std::size_t i = 0; i < rows; ++i) motor_torque.push_back(normal(random));
    period.assign(rows, 0.001);
    period[0] = period[gap] = 0.0;
    for (std::size_t i = 0; i < rows; ++i) time.push_back(0.001 * static_cast<double>(i));
  }
  batch::Channels channels() const {
    return {
        rows,
        q.data(),
        theta.data(),
        load.data(),
        {v.data(), a.data(), temperature.data(), motor_torque.data(), period.data(), time.data()}};
  }
  Sample<double> operator[](std::size_t i) const {
    Sample<double> at;
    at.output_position = Angle<double>::from_radians(q[i]);
    at.output_velocity = v[i];
    at.output_acceleration = a[i];
    at.motor_position = Angle<double>::from_radians(theta[i]);
    at.temperature = temperature[i];
    at.known_load = load[i];
    at.motor_torque = motor_torque[i];
    at.period = period[i];
    at.time = time[i];
    return at;
  }
};

/// Columns of the design over the whole log, column after column.
std::vector<double> fill(const batch::Design& design, const RandomLog& log,
                         std::span<const double> coefficients) {
  std::vector<double> out(design.columns() * rows);
  batch::Memory memory = design.fresh();
  batch::in_chunks({0, rows}, [&](std::size_t first, std::size_t count) {
    design.fill(log.channels(), first, count, coefficients, memory, out.data() + first, rows);
  });
  return out;
}

/// Checks columns and predictions of a model against the design of the same effects.
template <typename... Effects>
void check_equal(Model<double, Effects...> model, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<batch::AnyEffect> effects;
  std::vector<double> coefficients;
  const auto take = [&]<typename Effect>(Part<double, Effect>& part) {
    batch::AnyEffect any = batch::effect_by_name(part.effect.name);
    if constexpr (HarmonicEffect<Effect>) {
      batch::set_harmonics(any, part.effect.harmonics());
    }
    if constexpr (requires { part.effect.direction_width; }) {
      part.effect.direction_width = 0.02;
      batch::set_shape(any, "direction_width", 0.02);
    }
    if constexpr (requires { part.effect.resonance_velocity; }) {
      part.effect.resonance_velocity = 0.1;
      batch::set_shape(any, "resonance_velocity", 0.1);
    }
    if constexpr (requires { part.effect.path; }) {
      batch::set_shape(any, "path", part.effect.path);
    }
    effects.push_back(any);
    for (double& c : part.coefficients) coefficients.push_back(c = normal(random));
  };
  std::apply([&](auto&... part) { (take(part), ...); }, model.parts);
  const batch::Design design(effects, model.gear);
  REQUIRE(design.columns() == coefficients.size());

  const RandomLog log(seed + 1);
  const auto columns = fill(design, log, coefficients);
  std::vector<double> predicted(rows);
  batch::Memory memory = design.fresh();
  batch::in_chunks({0, rows}, [&](std::size_t first, std::size_t count) {
    design.predict(log.channels(), first, count, coefficients, memory, predicted.data() + first);
  });
  typename Model<double, Effects...>::State state;
  std::tuple<StateOf<Effects>...> states;
  for (std::size_t i = 0; i < rows; ++i) {
    auto at = log[i];
    double torque = 0;
    if (at.period == 0.0) {
      state = {};
      states = {};
      at.period = 0.001;  // a device has some period; where it starts anew any will do
    }
    REQUIRE(model.predict(at, state, torque) == Status::ok);
    CHECK(same_bits(predicted[i], torque));
    model.prepare(at);
    std::size_t k = 0;
    const auto compare = [&](const auto& part, auto& own) {
      for (const double value : row_of<double>(part.effect, at, own)) {
        CHECK(same_bits(columns[k++ * rows + i], value));
      }
    };
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      (compare(std::get<I>(model.parts), std::get<I>(states)), ...);
    }(std::index_sequence_for<Effects...>{});
  }
}

template <typename Effect>
Effect with_orders(std::vector<Harmonic> harmonics) {
  Effect effect;
  effect.assign(harmonics);
  return effect;
}

constexpr Pair flexspline_pair = Pair::wave_generator_on_flexspline;
constexpr Pair circular_pair = Pair::wave_generator_on_circular_spline;

using D = double;

}  // namespace

TEST_CASE("columns and sums of a design have the bits of the plain rows: friction") {
  check_equal(
      Model<D, Offset<D>, CoulombFriction<D>, ViscousFriction<D>, NonlinearViscousFriction<D>,
            StribeckFriction<D>, DirectionDependentFriction<D>>{},
      50);
  check_equal(Model<D, CoulombFrictionPerDirection<D>, TemperatureDrift<D>>{}, 51);
}

TEST_CASE("columns and sums of a design have the bits of the plain rows: load") {
  check_equal(Model<D, LoadDependentFriction<D>, Inertia<D>, Gravity<D>, GainError<D>>{}, 52);
  check_equal(Model<D, Gravity<D>, Offset<D>, LoadDependentFriction<D>>{}, 53);
  check_equal(Model<D, GainError<D>>{}, 54);
}

TEST_CASE("columns and sums of a design have the bits of the plain rows: ripple") {
  std::vector<Harmonic> dense;
  for (std::uint32_t k = 1; k <= 11; ++k) dense.push_back({k, Pair::output_on_housing});
  using Ripple = Model<D, OutputRipple<D, 11>, WaveGeneratorRipple<D, 5>, Cogging<D, 3>, Inertia<D>,
                       Gravity<D>, LoadDependentFriction<D>>;
  for (const auto output : {OutputSpline::circular, OutputSpline::flex, OutputSpline::unknown}) {
    for (const bool encoder : {false, true}) {
      for (const double ratio : {101.0, 100.7}) {
        Ripple model;
        model.gear = Gear<D>::from_ratio(ratio, output, encoder);
        std::get<0>(model.parts).effect = with_orders<OutputRipple<D, 11>>(dense);
        std::get<1>(model.parts).effect =
            with_orders<WaveGeneratorRipple<D, 5>>({{2, circular_pair},
                                                    {3, circular_pair},
                                                    {4, circular_pair},
                                                    {1, flexspline_pair},
                                                    {2, flexspline_pair}});
        std::get<2>(model.parts).effect = with_orders<Cogging<D, 3>>(
            {{7, Pair::motor_on_stator}, {8, Pair::motor_on_stator}, {42, Pair::motor_on_stator}});
        check_equal(model, 55);
      }
    }
  }
}

TEST_CASE("columns and sums of a design have the bits of the plain rows: torsion and memory") {
  for (const double path : {0.0, 1.0}) {
    Model<D, TorsionalHysteresis<D>, MeshCompliance<D>, KinematicError<D, 3>,
          WaveGeneratorCompliance<D>>
        model;
    model.gear = Gear<D>::from_ratio(101.0, OutputSpline::circular, true);
    std::get<0>(model.parts).effect.path = path;
    std::get<2>(model.parts).effect = with_orders<KinematicError<D, 3>>(
        {{2, Pair::output_on_housing}, {1, circular_pair}, {2, circular_pair}});
    check_equal(model, 56);
  }
}

TEST_CASE("columns and sums of a design have the bits of the plain rows: friction with memory") {
  check_equal(Model<D, PreslidingFriction<D>, TemperatureDependentFriction<D>,
                    PositionDependentFriction<D>, CoulombFriction<D>, TimeDrift<D>>{},
              57);
}

TEST_CASE("columns and sums of a design have the bits of the plain rows: errors of a sensor") {
  check_equal(Model<D, ThermalGradientDrift<D>, Gravity<D>, GainTemperatureDependence<D>,
                    SensorNonlinearity<D>, TorqueHysteresis<D>, MotorCrosstalk<D>, SensorLag<D>>{},
              58);
  check_equal(Model<D, TorqueConstantError<D>, Inertia<D>, TimeDrift<D>>{}, 59);
}

TEST_CASE(
    "columns and sums of a design have the bits of the plain rows: modulated ripple and mesh") {
  std::vector<Harmonic> mixed{{1, circular_pair},
                              {2, circular_pair},
                              {3, circular_pair},
                              {1, flexspline_pair},
                              {7, Pair::motor_on_stator}};
  for (const bool encoder : {false, true}) {
    Model<D, SpeedDependentRipple<D, 5>, Backlash<D>, TemperatureDependentStiffness<D>> model;
    model.gear = Gear<D>::from_ratio(101.0, OutputSpline::circular, encoder);
    std::get<0>(model.parts).effect = with_orders<SpeedDependentRipple<D, 5>>(mixed);
    check_equal(model, 60);
  }
}

TEST_CASE_TEMPLATE("effects with memory have the same bits side by side as alone", Effect,
                   PreslidingFriction<D>, TorqueHysteresis<D>, ThermalGradientDrift<D>,
                   SensorLag<D>) {
  const RandomLog log(64);
  for (const std::size_t count : {2U, 3U, 4U, 5U}) {
    std::vector<batch::AnyEffect> effects;
    std::vector<double> alone;
    for (std::size_t k = 0; k < count; ++k) {
      Effect effect;
      effect.*(Effect::shapes()[0].field) *= 1.0 + static_cast<double>(k);
      effects.push_back(effect);
      const auto columns = fill(batch::Design({effect}, {}), log, {});
      alone.insert(alone.end(), columns.begin(), columns.end());
    }
    CHECK(fill(batch::Design(effects, {}), log, {}) == alone);
  }
}

TEST_CASE("blocks of a run with memory give the same sums in any order and on any threads") {
  const batch::Design design({Offset<D>{}, TorsionalHysteresis<D>{}, MeshCompliance<D>{}}, {});
  REQUIRE(design.remembers());
  const RandomLog log(61);
  const batch::Channels channels = log.channels();
  const batch::Problem problem{design, channels, log.v.data(), nullptr, {}, {}};
  const std::vector<batch::Rows> blocks{{0, 40}, {40, 1100}, {1100, 1200}, {1200, 2300}};
  const std::vector<batch::Rows> turned(blocks.rbegin(), blocks.rend());
  const auto one = batch::accumulate(problem, blocks, batch::Precision::plain, true, 1);
  const auto two = batch::accumulate(problem, turned, batch::Precision::plain, true, 3);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const auto& other = two[blocks.size() - 1 - b];
    for (std::size_t k = 0; k < one[b].high.size(); ++k) {
      CHECK(same_bits(one[b].high[k], other.high[k]));
    }
  }
  const auto columns = fill(design, log, {});
  double sum = 0;
  for (std::size_t i = 1100; i < 1200; ++i) sum += columns[rows + i];
  CHECK(one[2].high[1] == doctest::Approx(sum).epsilon(1e-12));
}

TEST_CASE("a row that cannot be read is passed over by the memory and flagged as NaN") {
  const batch::Design design({TorsionalHysteresis<D>{}}, {});
  const RandomLog log(62);
  RandomLog broken(62);
  RandomLog without(62);
  broken.load[500] = std::numeric_limits<double>::quiet_NaN();
  without.load[500] = without.load[499];  // standing still says nothing either
  const auto marked = fill(design, broken, {});
  const auto still = fill(design, without, {});
  for (std::size_t i = 0; i < rows; ++i) {
    if (i == 500) {
      CHECK(std::isnan(marked[i]));
    } else {
      CHECK(same_bits(marked[i], still[i]));
    }
  }
}

TEST_CASE("rows are settled once no start, wherever in the widths, makes a difference") {
  TorsionalHysteresis<D> effect;
  effect.load_width = 30.0;
  const batch::Design design({effect}, {});
  RandomLog log(63);
  double path = 0;
  for (double& value : log.load) value = path += 0.05 * (value + 2.0);
  std::array<bool, rows> settled{};
  batch::Memory memory = design.fresh();
  batch::in_chunks({0, rows}, [&](std::size_t first, std::size_t count) {
    design.settled(log.channels(), first, count, {}, memory, settled.data() + first);
  });
  const auto low = [&](double start) {
    std::vector<double> wide;
    double z = start;
    for (std::size_t i = 0; i < rows; ++i) {
      if (i == 0 || i == gap) {
        z = start;
      } else {
        z = std::clamp(z + log.load[i] - log.load[i - 1], -30.0, 30.0);
      }
      wide.push_back(z);
    }
    return wide;
  };
  const auto a = low(-30.0);
  const auto b = low(30.0);
  CHECK_FALSE(settled[0]);
  CHECK_FALSE(settled[gap]);
  CHECK(settled[gap - 1]);
  CHECK(settled[rows - 1]);
  for (std::size_t i = 0; i < rows; ++i) CHECK(settled[i] == (a[i] == b[i]));
}

TEST_CASE("without coefficients the load is the known load alone") {
  const batch::Design design({Inertia<D>{}, GainError<D>{}}, {});
  const RandomLog log(60);
  const auto known = fill(design, log, {});
  const std::array<double, 2> coefficients{2.0, 0.0};
  const auto carried = fill(design, log, coefficients);
  for (std::size_t i = 0; i < rows; ++i) {
    CHECK(known[rows + i] == log.load[i]);
    CHECK(carried[rows + i] == log.load[i] + 2.0 * log.a[i]);
  }
}

TEST_CASE("a channel that the log lacks is at rest, unloaded and at 25 °C") {
  const batch::Design design({ViscousFriction<D>{}, TemperatureDrift<D>{}, GainError<D>{}}, {});
  std::vector<double> out(4 * 10, -1.0);
  batch::Channels channels;
  channels.size = 10;
  design.fill(channels, 0, 10, {}, out.data(), 10);
  for (const double value : out) CHECK(value == 0.0);
}

TEST_CASE("structure is found where orders are 1 to n of one pair, n of four or more") {
  const auto structure = [](std::vector<batch::AnyEffect> effects) {
    return batch::structure_of(batch::Design(std::move(effects), {}));
  };
  const auto ripple = [](std::vector<Harmonic> harmonics) {
    batch::AnyEffect any = batch::effect_by_name("output_ripple");
    batch::set_harmonics(any, harmonics);
    return any;
  };
  const std::vector<Harmonic> four{{1, {}}, {2, {}}, {3, {}}, {4, {}}};
  CHECK_FALSE(structure({Offset<D>{}, ViscousFriction<D>{}}).has_value());
  CHECK_FALSE(structure({ripple({{1, {}}, {2, {}}, {3, {}}})}).has_value());
  CHECK_FALSE(structure({ripple({{1, {}}, {2, {}}, {3, {}}, {5, {}}})}).has_value());
  CHECK_FALSE(structure({ripple({{2, {}}, {3, {}}, {4, {}}, {5, {}}})}).has_value());
  batch::AnyEffect modulated = batch::effect_by_name("speed_dependent_ripple");
  std::vector<Harmonic> turning(four);
  for (Harmonic& harmonic : turning) harmonic.pair = Pair::motor_on_stator;
  batch::set_harmonics(modulated, turning);
  CHECK_FALSE(structure({modulated}).has_value());

  const auto found = structure({ViscousFriction<D>{}, ripple(four), Offset<D>{}, Inertia<D>{}});
  REQUIRE(found.has_value());
  CHECK(found->ripple == 1);
  CHECK(found->harmonics == 4);
  CHECK(found->dense == std::vector<std::size_t>{0, 10});
  // ones, viscous, inertia, target, then the ripple
  CHECK(found->order == std::vector<int>{1, 4, 5, 6, 7, 8, 9, 10, 11, 0, 2, 3});
}

TEST_CASE("effects, shapes and pairs that do not exist are refused by name") {
  CHECK_THROWS_WITH_AS(batch::effect_by_name("friktion"), "there is no effect named 'friktion'",
                       std::invalid_argument);
  batch::AnyEffect offset = batch::effect_by_name("offset");
  CHECK_THROWS_AS(batch::set_shape(offset, "direction_width", 1.0), std::invalid_argument);
  const std::vector<Harmonic> one{{1, Pair::motor_on_stator}};
  CHECK_THROWS_AS(batch::set_harmonics(offset, one), std::invalid_argument);
  batch::AnyEffect ripple = batch::effect_by_name("output_ripple");
  CHECK_THROWS_AS(batch::set_harmonics(ripple, one), std::invalid_argument);
  const std::vector<Harmonic> many(batch::max_harmonics + 1);
  CHECK_THROWS_AS(batch::set_harmonics(ripple, many), std::invalid_argument);
  CHECK_THROWS_AS(batch::pair_by_name("moon_on_sun"), std::invalid_argument);
  for (const auto& [name, pair] : batch::pair_names) {
    CHECK(batch::pair_by_name(name) == pair);
    CHECK(batch::name_of(pair) == name);
  }
}
