#include <doctest/doctest.h>

#include <limits>
#include <type_traits>
#include <vector>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

template <typename S>
constexpr S not_a_number = std::numeric_limits<S>::quiet_NaN();

template <typename S>
using Loaded = Model<S, Offset<S>, LoadDependentFriction<S>, Inertia<S>, Gravity<S>,
                     WaveGeneratorRipple<S, 2>, TemperatureDrift<S>>;

template <typename S>
constexpr Loaded<S> loaded_model() {
  Loaded<S> model;
  model.gear = Gear<S>::from_ratio(101, OutputSpline::circular, false);
  std::get<0>(model.parts).coefficients = {S(0.5)};
  std::get<1>(model.parts).coefficients = {S(0.25)};
  std::get<2>(model.parts).coefficients = {S(2)};
  std::get<3>(model.parts).coefficients = {S(4), S(8)};
  std::get<4>(model.parts).effect = {
      {{{{1, Pair::wave_generator_on_flexspline}, {2, Pair::wave_generator_on_circular_spline}}}}};
  std::get<4>(model.parts).coefficients = {S(1), S(2), S(3), S(4)};
  std::get<5>(model.parts).coefficients = {S(0.125), S(0)};
  return model;
}

}  // namespace

TEST_CASE_TEMPLATE("a model sums its effects and fills the load by itself", S, float, double) {
  constexpr auto model = loaded_model<S>();
  Sample<S> at;
  at.known_load = S(-20);
  at.output_acceleration = S(3);
  at.output_velocity = S(1);
  at.output_position = Angle<S>::from_turns(S(0.25));
  at.temperature = S(33);
  // load = −20 + 2·3 + 4; θ = 101/4 turns: flexspline at 1/4, circular spline at 100/4 turns
  const S load_friction = S(0.25) * S(10);
  const S expected = S(0.5) + load_friction + S(6) + S(4) + (S(2) + S(3)) + S(1);
  S torque = 0;
  CHECK(model.predict(at, torque) == Status::ok);
  CHECK(torque == expected);
}

TEST_CASE_TEMPLATE("the motor's encoder overrules the gear ratio", S, float, double) {
  auto model = loaded_model<S>();
  model.gear.motor_encoder = true;
  Sample<S> at;
  at.output_position = Angle<S>::from_turns(S(0.25));
  at.motor_position = Angle<S>::from_turns(S(0.5));
  model.prepare(at);
  CHECK(at.wave_generator_on_flexspline.fraction == at.motor_position.phase.fraction);
  CHECK(at.wave_generator_on_circular_spline.shortest() == S(0.25));
}

TEST_CASE_TEMPLATE("what is not finite is flagged and the last torque stays", S, float, double) {
  const auto model = loaded_model<S>();
  std::mt19937_64 random(40);
  const auto good = usual_sample<S>(random);
  S torque = 7;
  for (const S bad : {not_a_number<S>, std::numeric_limits<S>::infinity()}) {
    for (S Sample<S>::* field : {&Sample<S>::output_velocity, &Sample<S>::output_acceleration,
                                 &Sample<S>::temperature, &Sample<S>::known_load}) {
      auto at = good;
      at.*field = bad;
      CHECK(model.predict(at, torque) == Status::not_finite);
      CHECK(torque == S(7));
    }
  }
  CHECK(model.predict(good, torque) == Status::ok);
  CHECK(torque != S(7));
}

TEST_CASE_TEMPLATE("a channel that no effect reads may hold anything", S, float, double) {
  Model<S, Offset<S>, CoulombFriction<S>> model;
  std::get<0>(model.parts).coefficients = {S(3)};
  Sample<S> at;
  at.temperature = at.output_acceleration = at.known_load = at.load = not_a_number<S>;
  S torque = 0;
  CHECK(model.predict(at, torque) == Status::ok);
  CHECK(torque == S(3));
}

TEST_CASE_TEMPLATE("each channel is an angle, the load or one of the numbers, once", S, float,
                   double) {
  std::array<int, channel_names.size()> counted{};
  for (const Channel made : {Channel::output_position, Channel::motor_position, Channel::load}) {
    ++counted[std::size_t(made)];
  }
  Reading<S> in;
  Sample<S> at;
  for (const Number<S>& number : numbers<S>) {
    const auto place = std::size_t(number.channel);
    ++counted[place];
    in.*number.read = at.*number.at = S(100 + place);
  }
  for (std::size_t k = 0; k < counted.size(); ++k) {
    CHECK_MESSAGE(counted[k] == 1, channel_names[k]);
  }
  for (const Number<S>& number : numbers<S>) {  // no member stands in two rows
    const auto place = std::size_t(number.channel);
    CHECK_MESSAGE(in.*number.read == S(100 + place), number.name());
    CHECK_MESSAGE(at.*number.at == S(100 + place), number.name());
  }
  CHECK(channel_names[std::size_t(Channel::time)] == "time");
  CHECK(channel_names.size() == std::size_t(Channel::time) + 1);
}

TEST_CASE_TEMPLATE("a model without effects predicts zero", S, float, double) {
  constexpr Model<S> model{};
  S torque = 5;
  CHECK(model.predict(Sample<S>{}, torque) == Status::ok);
  CHECK(torque == S(0));
}

TEST_CASE_TEMPLATE("any finite sample gives a finite torque or is flagged", S, float, double) {
  Model<S, Offset<S>, CoulombFriction<S>, NonlinearViscousFriction<S>, StribeckFriction<S>,
        LoadDependentFriction<S>, Inertia<S>, Gravity<S>, TemperatureDrift<S>, GainError<S>>
      model;
  std::apply([](auto&... part) { (part.coefficients.fill(S(1.5)), ...); }, model.parts);
  std::mt19937_64 random(41);
  int flagged = 0;
  for (int i = 0; i < 100000; ++i) {
    const auto at = any_sample<S>(random);
    S torque = 7;
    const Status status = model.predict(at, torque);
    CHECK(math::is_finite(torque));
    flagged += status != Status::ok;
    if (status != Status::ok) CHECK(torque == S(7));
  }
  CHECK(flagged > 0);
}

TEST_CASE_TEMPLATE("the step cannot throw and the compiler can take it", S, float, double) {
  constexpr auto torque = [] {
    S found = 0;
    const Status status = loaded_model<S>().predict(Sample<S>{}, found);
    return status == Status::ok ? found : S(-1);
  }();
  static_assert(noexcept(std::declval<Loaded<S>>().predict(Sample<S>{}, std::declval<S&>())));
  static_assert(torque > S(0));
  S at_run_time = 0;
  CHECK(loaded_model<S>().predict(Sample<S>{}, at_run_time) == Status::ok);
  CHECK(same_bits(torque, at_run_time));
}

namespace {

template <typename S>
using Twisted = Model<S, Offset<S>, MeshCompliance<S>, TorsionalHysteresis<S>,
                      WaveGeneratorCompliance<S>, KinematicError<S, 1>>;

template <typename S>
constexpr Twisted<S> twisted_model() {
  Twisted<S> model;
  model.gear = Gear<S>::from_ratio(101, OutputSpline::circular, true);
  std::apply([](auto&... part) { (part.coefficients.fill(S(0.5)), ...); }, model.parts);
  return model;
}

template <typename S>
Status next(const Twisted<S>& model, std::mt19937_64& random, typename Twisted<S>::State& state,
            S& torsion) {
  return model.predict(usual_sample<S>(random), state, torsion);
}

}  // namespace

static_assert(std::is_empty_v<Loaded<double>::State>);
static_assert(!Loaded<double>::remembers && Twisted<double>::remembers);
static_assert(std::is_trivially_copyable_v<Twisted<float>::State>);

TEST_CASE_TEMPLATE("a state that is saved and restored goes on as if nothing had been", S, float,
                   double) {
  const auto model = twisted_model<S>();
  std::mt19937_64 random(42);
  typename Twisted<S>::State state;
  S torsion = 0;
  for (int i = 0; i < 20; ++i) REQUIRE(next<S>(model, random, state, torsion) == Status::ok);
  const auto saved = state;
  const auto there = random;
  std::vector<S> through;
  for (int i = 0; i < 20; ++i) {
    REQUIRE(next<S>(model, random, state, torsion) == Status::ok);
    through.push_back(torsion);
  }
  state = saved;
  random = there;
  bool reset_differs = false;
  typename Twisted<S>::State fresh;
  for (const S expected : through) {
    auto copy = random;
    REQUIRE(next<S>(model, random, state, torsion) == Status::ok);
    CHECK(same_bits(torsion, expected));
    REQUIRE(next<S>(model, copy, fresh, torsion) == Status::ok);
    reset_differs |= torsion != expected;
  }
  CHECK(reset_differs);
}

TEST_CASE_TEMPLATE("what is not finite never enters a state", S, float, double) {
  const auto model = twisted_model<S>();
  std::mt19937_64 random(43);
  typename Twisted<S>::State state;
  typename Twisted<S>::State clean;
  S torsion = 7;
  S expected = 7;
  for (int i = 0; i < 100; ++i) {
    const auto at = usual_sample<S>(random);
    REQUIRE(model.predict(at, clean, expected) == Status::ok);
    for (const S bad : {not_a_number<S>, std::numeric_limits<S>::infinity()}) {
      for (S Sample<S>::* field : {&Sample<S>::known_load, &Sample<S>::motor_torque}) {
        auto broken = at;
        broken.*field = bad;
        const S before = torsion;
        CHECK(model.predict(broken, state, torsion) == Status::not_finite);
        CHECK(torsion == before);
      }
    }
    REQUIRE(model.predict(at, state, torsion) == Status::ok);
    CHECK(same_bits(torsion, expected));
  }
}

TEST_CASE_TEMPLATE("a torsion that overflows leaves the state as it was", S, float, double) {
  auto model = twisted_model<S>();
  std::get<0>(model.parts).coefficients = {std::numeric_limits<S>::max()};
  std::get<2>(model.parts).coefficients[0] = std::numeric_limits<S>::max();
  typename Twisted<S>::State state;
  Sample<S> at;
  S torsion = 7;
  const auto hysteresis = [&] { return state_of<2>(state); };
  REQUIRE(model.predict(at, state, torsion) == Status::ok);
  const auto before = hysteresis();
  at.known_load = S(1000);
  CHECK(model.predict(at, state, torsion) == Status::not_finite);
  CHECK(hysteresis().load == before.load);
  CHECK(hysteresis().elements.stretch == before.elements.stretch);
}
