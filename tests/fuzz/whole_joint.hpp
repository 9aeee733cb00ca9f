/// A joint with every stage and, in each of its models, every effect that may act there.
#pragma once

#include <string_view>
#include <type_traits>

#include "flexspline/effects/catalogue.hpp"
#include "flexspline/joint.hpp"

namespace flexspline::fuzz {

/// The model of all effects whose `targets` has a letter.
template <typename S, char letter>
struct ModelOf {
  template <typename Made, typename... Effects>
  struct Gathered {
    using type = Made;
  };
  template <typename... Kept, typename First, typename... Rest>
  struct Gathered<Model<S, Kept...>, First, Rest...> {
    static constexpr bool acts = First::targets.find(letter) != std::string_view::npos;
    using Longer = typename std::conditional_t<acts, std::type_identity<Model<S, Kept..., First>>,
                                               std::type_identity<Model<S, Kept...>>>::type;
    using type = typename Gathered<Longer, Rest...>::type;
  };
  template <typename... Effects>
  using Of = typename Gathered<Model<S>, Effects...>::type;

  using type = Catalogue<Of, S, 3>;
};

template <typename S>
using WholeJoint = Joint<S, typename ModelOf<S, 'S'>::type, typename ModelOf<S, 'M'>::type,
                         typename ModelOf<S, 'D'>::type, Model<S, Gravity<S>>>;

/// What a joint's chain may be made of, a bit each.
enum Choice : std::uint16_t {
  sensor_by_voltage = 1,
  by_motor = 2,
  by_euler = 4,
  no_loop = 8,
  kalman = 16,
  at_rest_by_link = 32,
  no_sensor = 64,
  no_thermistor = 128,
  watched_low = 256,
  watched_high = 512,
  lagging = 1024,
  checked = 2048,
  derived = 4096,
  adapting = 8192,
  compensating = 16384,
};

template <typename S>
void set_up_preparing(typename Chain<S>::Config& sensing, std::uint16_t choice) {
  if ((choice & derived) != 0) sensing.differentiator = typename Differentiator<S>::Config{};
  if ((choice & checked) == 0) return;
  auto& checks = sensing.checks.emplace();
  checks.least_voltage = S(-2);
  checks.most_voltage = S(2);
  checks.least_thermistor_voltage = S(0.1);
  checks.most_thermistor_voltage = S(3.2);
  checks.most_temperature = S(100);
  checks.most_sensor_torque = checks.most_motor_torque = S(100);
  checks.most_speed = S(10);
  if ((choice & derived) == 0) {
    checks.most_acceleration = S(1000);
    checks.way = S(0.02);
  }
  checks.twist = S(1);
  checks.apart = S(10);
  checks.gear = Gear<S>::from_ratio(101.0, OutputSpline::circular, true);
}

template <typename S>
void set_up_sensing(typename Chain<S>::Config& sensing, std::uint16_t choice) {
  if ((choice & no_thermistor) == 0) sensing.thermistor = Thermistor<S>{};
  sensing.sensor = (choice & no_sensor) == 0;
  if (!sensing.sensor) return;
  typename Chain<S>::Compensation::Config compensation;
  compensation.coefficients = {S(0.02), S(-0.001)};
  compensation.gradient = S(0.05);
  compensation.thermal_lag = (choice & lagging) != 0 ? S(60) : S(0);
  compensation.low = S(0);
  compensation.high = S(70);
  sensing.compensation = compensation;
  if ((choice & sensor_by_voltage) != 0) sensing.calibration = Calibration<S>{S(62.7), S(2.2)};
}

template <typename S>
void set_up_estimating(typename Chain<S>::Config& chain, std::uint16_t choice) {
  const auto rule = (choice & by_euler) != 0 ? Discretisation::euler : Discretisation::exact;
  chain.sensor = (choice & no_sensor) == 0;
  const bool motor = !chain.sensor || (choice & by_motor) != 0;
  chain.observer = {S(80), rule};
  chain.observer_input = motor ? ObserverInput::motor_torque : ObserverInput::sensor_torque;
  chain.compliance = Compliance<S>{S(15000), S(0.05), S(0.05)};
  if ((choice & no_loop) == 0) {
    chain.hysteresis = LoadHysteresis<S>{S(5), {S(1e-5), S(1e-5), S(5e-6), S(5e-6)}};
  }
  chain.compliant_observer = {S(60), rule};
  if ((choice & kalman) != 0) {
    chain.kalman = typename Chain<S>::Kalman::Config{};
  } else {
    chain.logistic = LogisticMerge<S>{};
  }
  chain.at_rest = (choice & at_rest_by_link) != 0 ? AtRest::compliant_observer : AtRest::compliance;
  typename Chain<S>::Detector::Config detector;
  detector.negative.fill(S(2));
  detector.positive.fill(S(2.5));
  detector.speed_edges[0] = S(0.5);
  detector.release = S(0.8);
  detector.hold = S(0.05);
  chain.collision = detector;
  chain.watched = static_cast<Watched>((choice >> 8) & 3);
  if (!chain.sensor && chain.watched == Watched::sensor) chain.watched = Watched::merged;
}

/// The first eight coefficients of the observer's model learn, two with a range that is empty.
template <typename S>
void set_up_adapting(typename Chain<S>::Config& chain, std::uint16_t choice) {
  if ((choice & adapting) == 0) return;
  auto& made = chain.adaptation.emplace();
  made.noise = S(0.5);
  made.interval = S(0.005);
  made.memory = S(1);
  made.least_speed = S(0.01);
  made.low.fill(S(-1));
  made.high.fill(S(1));
  made.low[2] = made.high[2] = made.low[7] = made.high[7] = S(0.03);
  for (std::size_t k = 0; k < 8; ++k) made.factor[k * (k + 3) / 2] = S(0.01);
  made.factor[1] = S(0.5);
  const bool known = chain.sensor && chain.observer_input == ObserverInput::motor_torque;
  made.load = known ? AdaptationLoad::sensor : AdaptationLoad::free;
  const bool used = (choice & compensating) != 0;
  made.use = used ? AdaptationUse::compensate : AdaptationUse::monitor;
}

/// Coefficients that make each effect a few hundredths of a Nm or rad; orders on all pairs.
template <typename S, typename... Effects>
void set_up(Model<S, Effects...>& model, S scale) {
  model.gear = Gear<S>::from_ratio(101.0, OutputSpline::circular, true);
  const auto fill = [scale]<typename Effect>(Part<S, Effect>& part) {
    part.coefficients.fill(scale);
    if constexpr (HarmonicEffect<Effect>) {
      std::array<Harmonic, 3> harmonics;
      for (std::size_t k = 0; k < harmonics.size(); ++k) {
        harmonics[k] = {static_cast<std::uint32_t>(2 * k + 1),
                        Effect::pairs[k % Effect::pairs.size()]};
      }
      part.effect.assign(harmonics);
    }
  };
  std::apply([&](auto&... part) { (fill(part), ...); }, model.parts);
}

template <typename S>
WholeJoint<S> whole_joint(std::uint16_t choice) {
  WholeJoint<S> made{};
  set_up_preparing<S>(made.sensing, choice);
  set_up_sensing<S>(made.sensing, choice);
  set_up_estimating<S>(made.estimating, choice);
  set_up_adapting<S>(made.estimating, choice);
  set_up(made.sensor, S(0.02));
  set_up(made.observed, S(0.03));
  set_up(made.torsion, S(1e-4));
  set_up(made.carried, S(0.5));
  made.effective_ratio = S(101);
  made.inertia = S(0.4);
  made.link_inertia = S(0.3);
  made.low = S(0);
  made.high = S(70);
  return made;
}

}  // namespace flexspline::fuzz
