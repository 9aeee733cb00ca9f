// One absurd sample is flagged, and nothing remembers it.
#include <doctest/doctest.h>

#include <vector>

#include "../fuzz/step_invariants.hpp"
#include "../fuzz/whole_joint.hpp"
#include "flexspline/estimators/order_tracker.hpp"
#include "flexspline/estimators/ripple_oscillator.hpp"
#include "flexspline/estimators/structural_damping.hpp"
#include "random_samples.hpp"

using namespace flexspline;

namespace {

constexpr int rows = 120;
constexpr int absurd_row = 60;

template <typename S>
constexpr std::array<S, 4> absurd{S(1e10), S(-1e10), std::numeric_limits<S>::max(),
                                  std::numeric_limits<S>::lowest()};

template <typename S>
std::array<Angle<S>, 4> far_angles() {
  return {Angle<S>::from_radians(S(1e11)), Angle<S>::from_radians(S(-3e38)),
          Angle<S>{Angle<S>::most_turns, {12345}}, Angle<S>{-Angle<S>::most_turns - 7, {12345}}};
}

/// A joint that swings: every channel moves, and the load goes there and back.
template <typename S>
Sample<S> swing(int k) {
  const double at = 0.05 * k;
  const double sine = static_cast<double>(
      math::phasor<double>(Angle<double>::from_radians(at).phase.fraction).sine);
  const double cosine = static_cast<double>(
      math::phasor<double>(Angle<double>::from_radians(at).phase.fraction).cosine);
  Sample<S> made;
  made.output_position = Angle<S>::from_turns(S(0.1 * sine));
  made.motor_position = Angle<S>::from_turns(S(10.1 * sine));
  made.output_velocity = S(0.6 * cosine);
  made.output_acceleration = S(-sine);
  made.temperature = S(30 + 5 * sine);
  made.known_load = S(20 * cosine);
  made.motor_torque = S(0.2 * cosine);
  made.period = S(0.001);
  made.time = S(0.001 * k);
  return made;
}

template <typename S, typename Effect>
Model<S, Effect> model_of(const Effect& effect) {
  Model<S, Effect> made{Gear<S>::from_ratio(101, OutputSpline::circular, true), {}, {}};
  std::get<0>(made.parts).effect = effect;
  std::get<0>(made.parts).coefficients.fill(S(1));
  return made;
}

/// A run in which one sample is what `change` makes of it, and its status.
template <typename S, typename M, typename Change>
std::vector<S> run(const M& model, Change change, Status expected) {
  typename M::State state;
  std::vector<S> torques;
  S torque = 0;
  for (int k = 0; k < rows; ++k) {
    Sample<S> at = swing<S>(k);
    if (k == absurd_row) change(at);
    CHECK(model.predict(at, state, torque) == (k == absurd_row ? expected : Status::ok));
    torques.push_back(torque);
  }
  return torques;
}

template <typename S>
bool same(const std::vector<S>& a, const std::vector<S>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), same_bits<S>);
}

template <typename S, typename M, typename Field>
void check_number(const M& model, Field field) {
  const auto without =
      run<S>(model, [&](Sample<S>& at) { at.*field = Reading<S>::missing; }, Status::not_finite);
  for (const S value : absurd<S>) {
    const auto with =
        run<S>(model, [&](Sample<S>& at) { at.*field = value; }, Status::out_of_range);
    CHECK(same(with, without));
  }
}

template <typename S, typename M>
void check_angle(const M& model, Angle<S> Sample<S>::* field) {
  typename M::State state;
  S torque = 0;
  std::vector<S> without;
  for (int k = 0; k < rows; ++k) {
    if (k != absurd_row) CHECK(model.predict(swing<S>(k), state, torque) == Status::ok);
    without.push_back(torque);
  }
  for (const Angle<S> angle : far_angles<S>()) {
    const auto with =
        run<S>(model, [&](Sample<S>& at) { at.*field = angle; }, Status::out_of_range);
    CHECK(same(with, without));
  }
}

template <typename S>
using Joint = fuzz::WholeJoint<S>;
template <typename S>
using Output = typename Joint<S>::Chain::Output;

template <typename S>
Reading<S> reading(int k) {
  const Sample<S> at = swing<S>(k);
  Reading<S> in = fuzz::calm_reading<S>(k);
  in.output_position = at.output_position;
  in.motor_position = at.motor_position;
  for (const Number<S>& each : numbers<S>) in.*each.read = at.*each.at;
  in.sensor_torque = at.known_load;
  in.sensor_voltage = at.known_load / S(62.7);
  return in;
}

template <typename S>
bool same_values(const Output<S>& a, const Output<S>& b) {
  const auto values = [](const Output<S>& of) {
    return std::vector<S>{of.temperature,         of.sensor_torque,
                          of.external_sensor,     of.external_observer,
                          of.external_compliance, of.external_compliant_observer,
                          of.external_merged,     of.merge_weight};
  };
  return same(values(a), values(b)) && a.contact == b.contact && a.missed == b.missed;
}

/// Two runs, of which one has an absurd reading where the other has none.
template <typename S, typename Put, typename Leave>
void check_reading(const Joint<S>& joint, Put put, Leave leave, Fault kind) {
  typename Joint<S>::State state, other;
  Output<S> with, without;
  for (int k = 0; k < rows; ++k) {
    Reading<S> in = reading<S>(k);
    Reading<S> missing = in;
    if (k == absurd_row) {
      put(in);
      leave(missing);
    }
    REQUIRE(joint.step(state, in, with) == Status::ok);
    REQUIRE(joint.step(other, missing, without) == Status::ok);
    CHECK(same_values<S>(with, without));
    CHECK(has(with.flags, Flag::out_of_range) == (k == absurd_row));
    CHECK_FALSE(has(without.flags, Flag::out_of_range));
    CHECK(with.faults == (without.faults | (k == absurd_row ? kind : Fault::none)));
  }
  CHECK(with.flags == without.flags);
}

template <typename S>
void check_numbers(const Joint<S>& joint) {
  using R = Reading<S>;
  constexpr std::array<std::pair<S R::*, Fault>, 8> all{
      {{&R::output_velocity, Fault::speed},
       {&R::output_acceleration, Fault::speed},
       {&R::motor_torque, Fault::motor},
       {&R::sensor_voltage, Fault::sensor},
       {&R::sensor_torque, Fault::sensor},
       {&R::thermistor_voltage, Fault::temperature},
       {&R::temperature, Fault::temperature},
       {&R::time, Fault::none}}};
  for (const auto& [field, kind] : all) {
    for (const S value : absurd<S>) {
      check_reading<S>(
          joint, [&](R& in) { in.*field = value; }, [&](R& in) { in.*field = R::missing; }, kind);
    }
  }
}

/// The last torque of an estimator that has no limits of its own, by readings that went through
/// them.
template <typename S, typename State, typename Step>
S run_alone(const Step& step, S value) {
  State state;
  S torque = 0;
  for (int k = 0; k < rows; ++k) {
    Reading<S> in = reading<S>(k);
    if (k == absurd_row) in.sensor_torque = value;
    bool beyond = false;
    (void)ReadingLimits<S>{}.take_out(in, beyond);
    const Status status = step(state, swing<S>(k), in.sensor_torque, torque);
    CHECK(status == (k == absurd_row ? Status::not_finite : Status::ok));
  }
  return torque;
}

template <typename S, typename State, typename Step>
void check_alone(const Step& step) {
  const S without = run_alone<S, State>(step, Reading<S>::missing);
  for (const S value : absurd<S>) CHECK(same_bits(run_alone<S, State>(step, value), without));
}

}  // namespace

TEST_CASE_TEMPLATE("an absurd sample leaves every effect as if it had been missing", S, float,
                   double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    CAPTURE(Effect::name);
    const auto model = model_of<S>(effect);
    for (const Number<S>& each : numbers<S>) {
      const bool own = each.channel == Channel::period;
      if (!own && reads<Effect>(each.channel)) check_number<S>(model, each.at);
    }
    if (reads<Effect>(Channel::load)) check_number<S>(model, &Sample<S>::known_load);
    const bool turns = reads<Effect>(Channel::motor_position);
    if (turns || reads<Effect>(Channel::output_position)) {
      check_angle<S>(model, &Sample<S>::output_position);
    }
    if (turns) check_angle<S>(model, &Sample<S>::motor_position);
  });
}

TEST_CASE_TEMPLATE("an absurd reading leaves every stage as if it had been missing", S, float,
                   double) {
  using namespace flexspline::fuzz;
  constexpr std::uint16_t all = sensor_by_voltage | kalman | lagging | checked | derived;
  for (const std::uint16_t choice :
       {std::uint16_t(0), all, std::uint16_t(no_sensor | by_euler | checked),
        std::uint16_t(by_motor | at_rest_by_link | watched_high | no_thermistor)}) {
    CAPTURE(choice);
    const auto joint = whole_joint<S>(choice);
    check_numbers<S>(joint);
    for (auto field : {&Reading<S>::output_position, &Reading<S>::motor_position}) {
      for (const Angle<S> angle : far_angles<S>()) {
        check_reading<S>(
            joint, [&](Reading<S>& in) { in.*field = angle; },
            [&](Reading<S>& in) { in.*field = std::nullopt; }, Fault::speed);
      }
    }
  }
}

TEST_CASE_TEMPLATE("an estimator that stands alone does without what the limits take out", S, float,
                   double) {
  using Tracker = OrderTracker<S, 8>;
  const auto orders = Tracker::config_of(std::array<std::uint32_t, 1>{2}, 1, 8);
  check_alone<S, typename Tracker::State>([&](auto& state, const auto& at, S reading, S& torque) {
    return Tracker::step(orders, state, at.motor_position.phase, reading, torque);
  });
  using Oscillator = RippleOscillator<S, 1>;
  check_alone<S, typename Oscillator::State>([](auto& state, const auto& at, S reading, S& torque) {
    const typename Oscillator::Config config{.orders = {2}};
    return Oscillator::step(config, state, at.motor_position.phase, reading, at.period, torque);
  });
  using Damping = StructuralDamping<S>;
  check_alone<S, typename Damping::State>([](auto& state, const auto& at, S reading, S& torque) {
    return Damping::step({S(20)}, state, reading, at.period, torque);
  });
}

TEST_CASE_TEMPLATE("a hysteresis that takes an absurd load never finds back", S, float, double) {
  using Hysteresis = TorqueHysteresis<S>;
  auto guarded = model_of<S>(Hysteresis{});
  auto open = guarded;
  open.limits.most.fill(ReadingLimits<S>::none);
  const auto last = [](const auto& model, bool broken) {
    typename Model<S, Hysteresis>::State state;
    S torque = 0;
    for (int k = 0; k < 2000; ++k) {
      Sample<S> at = swing<S>(k);
      at.known_load *= S(0.01);  // a loop that is never wide enough to forget by
      if (k == absurd_row && broken) at.known_load = S(1e10);
      (void)model.predict(at, state, torque);
    }
    return torque;
  };
  CHECK(same_bits(last(guarded, true), last(guarded, false)));
  CHECK_FALSE(same_bits(last(open, true), last(open, false)));
}

TEST_CASE_TEMPLATE("a reading at its limit is taken, one behind it is not", S, float, double) {
  ReadingLimits<S> limits;
  limits.motor_torque = S(3);
  limits.output_velocity = limits.none;
  for (const S sign : {S(1), S(-1)}) {
    Reading<S> in;
    in.motor_torque = sign * S(3);
    in.output_velocity = sign * std::numeric_limits<S>::max();
    bool beyond = false;
    CHECK(limits.take_out(in, beyond) == Fault::none);
    CHECK(in.motor_torque == sign * S(3));
    CHECK_FALSE(beyond);
    in.motor_torque = sign * S(3.0001);
    CHECK(limits.take_out(in, beyond) == Fault::motor);
    CHECK_FALSE(math::is_finite(in.motor_torque));
    CHECK(beyond);
  }
}

TEST_CASE_TEMPLATE("an angle goes on to 2^30 turns, either way", S, float, double) {
  for (const std::int32_t turns : {(1 << 30) - 1, 1 - (1 << 30)}) {
    CHECK(Angle<S>{turns, {1}}.in_range());
  }
  CHECK_FALSE(Angle<S>::from_turns(std::numeric_limits<S>::quiet_NaN()).in_range());
  Angle<S> kept{7, {1}};
  CHECK(read_radians(S(1e11), kept) == Status::out_of_range);
  CHECK(read_radians(S(-3e38), kept) == Status::out_of_range);
  CHECK(kept.turns == 7);
  const S quarter = S(2e7);  // a float has digits for two radians there, a double for 4e-9
  CHECK(read_radians(quarter, kept) == (sizeof(S) == 4 ? Status::out_of_range : Status::ok));
  CHECK(read_radians(S(1e6), kept) == Status::ok);
}
