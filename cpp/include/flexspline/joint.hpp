/// One joint, from raw readings to the external torque: the models of its parts and the chain.
///
///   limiting     readings beyond their limits → missing
///   preparing    reading checks, differentiator → readings
///   sensing      thermistor, compensation, calibration → temperature, sensor torque
///   models       what each part says of this sample
///   estimating   observer, compliance, merge, collision
///   adapting     the observer's model learns from the sample (estimators/adaptation.hpp)
///
/// All stages are those of a `Chain`; the models come between them, for they read the temperature.
/// The load that an effect reads is the sensor's external torque. The sensor's own part is asked
/// twice where it reads the load: once with none, which leaves y, then with the load τ of
///
///   τ + L(τ) = y,   τ ← y / (1 + (L(τ) − L(0)) / τ) from τ = y
///
/// for its effects L without memory: a gain is exact, a bend of a fifth at full load is right to
/// two thousandths of it. Those with a memory read that τ. In a joint without sensor the load is
/// the compliance's external torque of the sample before, or of the last that had one, not held at
/// the pole; 0 until there is one, and where the chain has no compliance.
///
/// A reading that is missing stays NaN (an angle: empty); the stages that need it are in `missed`. One
/// beyond its limit counts as missing, is flagged `out_of_range`, and its kind is in `faults`.
/// The models go on with the last good temperature. State{} has seen nothing: assign it after a
/// gap, or call `restart`, which keeps what was learned. Temperatures outside of [low, high], where the parts were fitted: `extrapolated`.
#pragma once

#include "flexspline/estimators/chain.hpp"
#include "flexspline/estimators/preprocessing.hpp"
#include "flexspline/model.hpp"
#include "flexspline/reading_limits.hpp"
#include "flexspline/torsion.hpp"

namespace flexspline {

/// The adaptation of a joint that has one, known at compile time.
template <typename T>
struct AdaptationOf {
  using type = Adaptation<float, 1>;  // of no joint
};
template <typename T>
  requires requires { typename T::Estimator; }
struct AdaptationOf<T> {
  using type = typename T::Estimator;
};
template <typename T>
struct AdaptationOf<std::optional<T>> : AdaptationOf<T> {};

/// Models (model.hpp, or host/any_model.hpp on a PC): `Sensor` of the sensor's part; `Observed` of the
/// observer's torque, without inertia; `Torsion` without the mesh and what the chain knows of
/// hysteresis; `Carried` of what the gear carries beside the load: gravity. `Model<S>`, without
/// effects, where there is none. Stages (stages.hpp): `Sensing` up to the sensor's torque, checks
/// and differentiator among them; `Estimating` behind it.
template <typename S, typename Sensor, typename Observed, typename Torsion, typename Carried,
          typename Sensing = AnyStages<S>, typename Estimating = AnyStages<S>>
struct Joint {
  using Chain = flexspline::Chain<S>;
  using Preparing = Preprocessing<S>;

  /// Whether readings go through stages before the chain.
  static constexpr bool prepares =
      !is_absent<decltype(Sensing::checks)> || !is_absent<decltype(Sensing::differentiator)>;
  struct Nothing {};

  /// Whether its observer's model may learn.
  static constexpr bool adapts = !is_absent<decltype(Estimating::adaptation)>;
  using Adapting =
      typename AdaptationOf<std::remove_const_t<decltype(Estimating::adaptation)>>::type;
  struct Fixed {};
  /// What its first effects say in a sample, and whether it may learn.
  struct Learning {
    S intrinsic = Chain::missing;  ///< Nm, of the model as it is
    typename Adapting::Numbers model{}, row{};
  };

  Sensing sensing;
  Estimating estimating;
  Sensor sensor;
  Observed observed;
  Torsion torsion;
  Carried carried;
  S effective_ratio = 1;                   ///< Ñ
  S inertia = 0;                           ///< kg m² at the output, of the observer
  S link_inertia = 0;                      ///< kg m² at the output, of the compliant observer
  S low = -std::numeric_limits<S>::max();  ///< °C, range of the parts' fits
  S high = std::numeric_limits<S>::max();
  ReadingLimits<S> limits{};

  struct State {
    [[no_unique_address]] std::conditional_t<prepares, typename Preparing::State, Nothing> prepared;
    typename Chain::State chain;
    S temperature = Chain::missing;  ///< °C, the last good one
    S gear_load = 0;                 ///< Nm, the compliance's last external torque not held
    typename Sensor::State sensor, sensor_without_load;
    typename Observed::State observed;
    typename Torsion::State torsion;
    typename Carried::State carried;
    [[no_unique_address]] std::conditional_t<adapts, typename Adapting::State, Fixed> adaptation;
  };

  /// What went through a period, for who records more than the estimates.
  struct Trace {
    typename Chain::Input input;  ///< what the stages read, the models' predictions among it
    typename Chain::Sensed sensed;
  };

  /// One period. `out` keeps the last good value of a stage that missed.
  constexpr Status step(State& state, const Reading<S>& in,
                        typename Chain::Output& out) const noexcept {
    Trace trace;
    return step(state, in, out, trace);
  }

  /// The same with its trace; after a bad period that is the one before.
  constexpr Status step(State& state, const Reading<S>& in, typename Chain::Output& out,
                        Trace& trace) const noexcept {
    if (!is_period(in.period)) return Status::bad_period;
    Reading<S> taken = in;
    bool beyond = false;
    out.faults = limits.take_out(taken, beyond);
    out.flags = beyond ? Flag::out_of_range : Flag::none;
    out.missed = Stage::none;
    if constexpr (prepares) Preparing::step(sensing, state.prepared, taken, out);
    run(state, taken, out, trace);
    if constexpr (prepares) Preparing::compare(sensing, out);
    return Status::ok;
  }

  /// Behind a gap: nothing is remembered but what was learned. `fresh` has seen nothing.
  static constexpr void restart(State& state, const State& fresh = {}) noexcept {
    [[maybe_unused]] auto learned = state.adaptation;
    state = fresh;
    if constexpr (adapts) {
      Adapting::interrupt(learned);
      state.adaptation = learned;
    }
  }

  /// The first coefficients of the observer's model as they are learned; as they are where none is.
  constexpr typename Adapting::Numbers adapted(const State& state) const noexcept
    requires adapts
  {
    const auto model = observed.template first_coefficients<Adapting::most>();
    return Adapting::coefficients(state.adaptation, model);
  }

  /// Makes what was learned its own: what `save` then writes begins there. A state that goes on
  /// with it begins anew from there.
  constexpr void adopt(const State& state) noexcept
    requires adapts
  {
    auto* config = given(estimating.adaptation);
    if (config == nullptr) return;
    const auto model = observed.template first_coefficients<Adapting::most>();
    config->factor = Adapting::factor(*config, state.adaptation, model);
    observed.take_first(Adapting::coefficients(state.adaptation, model));
  }

 private:
  /// What the chain asks of the models in one sample.
  struct Models {
    const Joint& joint;
    State& state;
    const Reading<S>& in;
    Sample<S> at;
    [[no_unique_address]] std::conditional_t<adapts, Learning, Fixed> learning;

    constexpr void measured(S temperature) noexcept {
      if (Chain::is_temperature(temperature)) state.temperature = temperature;
    }
    constexpr S beside_load(S torque, const typename Chain::Input&) noexcept {
      at = joint.sample(in, state.temperature, NumberPlaces{});
      return joint.sensing.sensor ? joint.beside_load(in, at, state, torque) : S(0);
    }
    constexpr void predict(S external, typename Chain::Input& input) noexcept {
      Sample<S> loaded = at;
      loaded.known_load = joint.sensing.sensor ? external : state.gear_load;
      joint.predict(in, loaded, state, input);
      if constexpr (adapts) joint.look(loaded, state, input, learning);
    }
  };

  constexpr void run(State& state, const Reading<S>& in, typename Chain::Output& out,
                     Trace& trace) const noexcept {
    trace.input = channels(in);
    Models models{*this, state, in, {}, {}};
    trace.sensed = Chain::run(sensing, estimating, state.chain, trace.input, out, models);
    if (!sensing.sensor && given(estimating.compliance) && !has(out.missed, Stage::compliance) &&
        !has(out.flags, Flag::saturated)) {
      state.gear_load = out.external_compliance;
    }
    out.flags = out.flags | extrapolated(models.at.temperature, low, high);
    if constexpr (adapts) learn(state, models.learning, trace, out);
  }

  /// What the adaptation reads of a sample; the observer goes by it where it is to.
  constexpr void look(Sample<S> at, const State& state, typename Chain::Input& input,
                      Learning& learning) const noexcept {
    const auto* config = given(estimating.adaptation);
    if (config == nullptr) return;
    evaluation::prepare(observed, at);
    learning.intrinsic = input.observer_intrinsic;
    learning.model = observed.template first_coefficients<Adapting::most>();
    learning.row = observed.template first_row<Adapting::most>(at);
    if (config->use == AdaptationUse::compensate) {
      const auto moved = Adapting::moved(state.adaptation, learning.model);
      input.observer_intrinsic += weighted<S>(learning.row, moved);
    }
  }

  constexpr void learn(State& state, const Learning& learning, const Trace& trace,
                       const typename Chain::Output& out) const noexcept {
    const auto* config = given(estimating.adaptation);
    if (config == nullptr) return;
    const bool by_sensor = estimating.observer_input == ObserverInput::sensor_torque;
    const bool known = config->load == AdaptationLoad::sensor;
    const S driven = by_sensor ? trace.sensed.torque : trace.input.motor_torque;
    typename Adapting::Input in;
    in.period = state.adaptation.wait + trace.input.period;
    in.torque = driven - learning.intrinsic - (known ? out.external_sensor : S(0));
    in.momentum = trace.input.momentum;
    in.velocity = trace.input.velocity;
    in.row = learning.row;
    in.clean = !out.contact && out.flags == Flag::none && out.faults == Fault::none;
    const Stage needed = known ? Stage::collision | Stage::sensor : Stage::collision;
    if (has(out.missed, needed)) in.torque = Chain::missing;
    const bool good =
        Adapting::advance(*config, state.adaptation, learning.model, in) == Status::ok;
    state.adaptation.wait = good ? S(0) : in.period;
  }

  /// A reading that may be infinite where it has no limit: infinite is missing.
  static constexpr S known(S value, S most) noexcept {
    return most < ReadingLimits<S>::none ? value : math::finite_or_nan(value);
  }

  /// What the stages read.
  constexpr typename Chain::Input channels(const Reading<S>& in) const noexcept {
    typename Chain::Input input;
    input.period = in.period;
    input.voltage = in.sensor_voltage;
    input.thermistor_voltage = in.thermistor_voltage;
    input.temperature = in.temperature;
    input.sensor_torque = in.sensor_torque;
    input.velocity = known(in.output_velocity, limits.output_velocity);
    input.motor_torque = effective_ratio * in.motor_torque;
    input.momentum = inertia == S(0) ? S(0) : inertia * input.velocity;
    input.link_momentum = link_inertia == S(0) ? S(0) : link_inertia * input.velocity;
    return input;
  }

  /// What the models read.
  template <std::size_t... k>
  constexpr Sample<S> sample(const Reading<S>& in, S temperature,
                             std::index_sequence<k...>) const noexcept {
    Sample<S> at;
    at.output_position = in.output_position.value_or(Angle<S>{});
    at.motor_position = in.motor_position.value_or(Angle<S>{});
    ((at.*numbers<S>[k].at = known(in.*numbers<S>[k].read, limits.of(numbers<S>[k].channel))), ...);
    at.temperature = temperature;
    at.period = in.period;
    return at;
  }

  /// What the models say of this sample.
  constexpr void predict(const Reading<S>& in, const Sample<S>& at, State& state,
                         typename Chain::Input& input) const noexcept {
    input.observer_intrinsic = predicted(observed, in, at, state.observed);
    input.gear_known = predicted(carried, in, at, state.carried);
    if (given(estimating.compliance)) input.torsion = mesh(in, at, state);
  }

  /// What the sensor reads beside the load.
  constexpr S beside_load(const Reading<S>& in, Sample<S> at, State& state,
                          S torque) const noexcept {
    if (sensor.template reads<Channel::load>()) {
      const S left = torque - predicted(sensor, in, at, state.sensor_without_load);
      at.known_load = sensor.follows_load ? behind_gain(at, left) : left;
    }
    return predicted(sensor, in, at, state.sensor);
  }

  /// The load whose scale and bend by the sensor leave `left`, see above; NaN stays NaN.
  constexpr S behind_gain(Sample<S> at, S left) const noexcept {
    at.known_load = S(0);
    evaluation::prepare(sensor, at);
    const S own = at.load;  // inertia and gravity of the sensor's part
    const S none = sensor.by_load(at);
    S load = left;
    for (int round = 0; round < gain_rounds; ++round) {
      at.load = own + load;
      const S more = sensor.by_load(at) - none;
      load = left / std::max(S(1) + (load == S(0) ? S(0) : more / load), least_gain);
    }
    return load;
  }
  static constexpr int gain_rounds = 3;
  static constexpr S least_gain = S(0.1);  ///< of a sensor: a bend never turns the load over

  /// The torsion's model reads no load: the chain has what does.
  constexpr S mesh(const Reading<S>& in, Sample<S> at, State& state) const noexcept {
    at.known_load = S(0);
    const S rest = predicted(torsion, in, at, state.torsion);
    if (!in.output_position || !in.motor_position || !math::is_finite(rest)) return Chain::missing;
    return mesh_torsion_left(torsion.gear, effective_ratio, *in.output_position,
                             in.motor_position->phase, rest);
  }

  /// NaN where the model cannot say.
  template <typename Model>
  static constexpr S predicted(const Model& model, const Reading<S>& in, const Sample<S>& at,
                               typename Model::State& state) noexcept {
    const bool turns = model.template reads<Channel::motor_position>();
    const bool angle = turns || model.template reads<Channel::output_position>();
    if (angle && !in.output_position) return Chain::missing;
    if (turns && model.gear.motor_encoder && !in.motor_position) return Chain::missing;
    return model.torque(at, state);
  }
};

}  // namespace flexspline
