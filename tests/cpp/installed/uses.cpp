// Uses every installed header in both precisions and links no library:
//
//   uses INCLUDE_FOLDER
//
// Fails where a header is installed that has no line here, or has a line and is not installed.
#include <array>
#include <cstdio>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

#include "flexspline/angle.hpp"
#include "flexspline/block.hpp"
#include "flexspline/coupling.hpp"
#include "flexspline/each_place.hpp"
#include "flexspline/effects/catalogue.hpp"
#include "flexspline/estimators/chain.hpp"
#include "flexspline/estimators/order_tracker.hpp"
#include "flexspline/estimators/preprocessing.hpp"
#include "flexspline/estimators/ripple_oscillator.hpp"
#include "flexspline/estimators/structural_damping.hpp"
#include "flexspline/fields.hpp"
#include "flexspline/joint.hpp"
#include "flexspline/lagged_slope.hpp"
#include "flexspline/self_heating.hpp"
#include "flexspline/sensor/bridge.hpp"
#include "flexspline/sensor/electronics.hpp"
#include "flexspline/swap.hpp"
#include "flexspline/torsion.hpp"

namespace {

using namespace flexspline;

template <typename S>
bool near(S value, double expected) {
  return math::absolute(static_cast<double>(value) - expected) < 1e-5;
}

template <typename S>
Sample<S> moving() {
  Sample<S> at;
  at.output_position = Angle<S>::from_turns(S(0.1));
  at.output_velocity = S(0.3);
  at.output_acceleration = S(2);
  at.motor_position = Angle<S>::from_turns(S(10.2));
  at.temperature = S(30);
  at.known_load = S(4);
  at.motor_torque = S(0.5);
  at.period = S(0.001);
  at.time = S(7);
  return at;
}

/// Whether a model of the effect alone says something, in two samples, where all are 1.
template <typename S, typename Effect>
bool predicts() {
  Model<S, Effect> model{Gear<S>::from_ratio(100, OutputSpline::flex, true), {}};
  std::get<0>(model.parts).coefficients.fill(S(1));
  typename Model<S, Effect>::State state{};
  S torque = 0;
  Sample<S> at = moving<S>();
  if (model.predict(at, state, torque) != Status::ok) return false;
  at.known_load = S(5);
  at.output_position = Angle<S>::from_turns(S(0.11));
  at.motor_position = Angle<S>::from_turns(S(10.3));
  at.temperature = S(31);
  return model.predict(at, state, torque) == Status::ok && torque != S(0);
}

template <typename S>
bool merges() {
  typename KalmanMerge<S>::State state;
  S merged = 0;
  return KalmanMerge<S>::step({}, state, S(1), S(3), S(3), S(0.001), merged) == Status::ok &&
         near(merged, 3);
}

template <typename S>
using Whole = Joint<S, Model<S, Offset<S>>, Model<S>, Model<S>, Model<S>>;

/// A joint whose sensor reads too much by `offset`, Nm.
template <typename S>
Whole<S> joint(S offset) {
  Whole<S> made{};
  made.sensing.sensor = true;
  std::get<0>(made.sensor.parts).coefficients = {offset};
  return made;
}

template <typename S>
bool steps(const Whole<S>& joint, double external) {
  typename Whole<S>::State state{};
  typename Chain<S>::Output out;
  Reading<S> in;
  in.period = S(0.001);
  in.sensor_torque = S(5);
  return joint.step(state, in, out) == Status::ok && near(out.external_sensor, external);
}

template <typename S>
struct Count {
  std::size_t total = 0;
  void structure(std::string_view) {}
  void numbers(std::string_view, const S*, std::size_t count, Range<S>) { total += count; }
  void harmonic(const Harmonic&) {}
  void gear(const Gear<S>&) {}
};

using Block = std::array<std::uint8_t, 256>;

template <typename S>
Block saved(const Whole<S>& joint) {
  Block bytes{};
  std::size_t size = 0;
  return save(joint, bytes, size) == BlockStatus::ok && size == block_size(joint) ? bytes : Block{};
}

template <typename S>
using Effects = Catalogue<std::tuple, S, 2>;

struct Use {
  std::string header;
  bool (*works)();
};

template <typename S>
const std::vector<Use> others = {
    {"angle.hpp", [] { return Angle<S>::from_turns(S(3.25)).turns == 3; }},
    {"block.hpp",
     [] {
       Whole<S> other = joint(S(0));
       return load(saved(joint(S(2))), other) == BlockStatus::ok && steps(other, 3);
     }},
    {"coupling.hpp",
     [] {
       Model<S, MeshCompliance<S>> mesh;
       std::get<0>(mesh.parts) = {{S(0.01)}, {S(0.01)}};
       typename Model<S, MeshCompliance<S>>::State state;
       S torque = 0;
       const Coupling<S> coupling{S(100), S(10), S(0.0099)};
       return coupling.torque(mesh, {}, S(-0.02), state, torque) == Status::ok &&
              math::absolute(mesh_torsion(torque, S(100), S(0.01)) + S(0.02)) < S(1e-5);
     }},
    {"each_place.hpp",
     [] {
       std::size_t sum = 0;
       for_each_place<40>([&](std::size_t k) { sum += k; });
       return sum == 780;
     }},
    {"fields.hpp",
     [] {
       std::size_t numbers = 0;
       for_each_field<Thermistor<S>>([&](const auto&) { ++numbers; });
       return numbers == 5;
     }},
    {"find_zero.hpp",
     [] {
       const auto f = [](S x) { return S(2) - x * x; };
       return near(find_zero(f, S(1), S(1), S(2), S(-2), S(1e-6)), 1.4142136);
     }},
    {"gear.hpp",
     [] {
       const auto gear = Gear<S>::from_ratio(100.25, OutputSpline::flex, false);
       return near(gear.motor_phase(Angle<S>::from_turns(S(2))).shortest(), -0.5);
     }},
    {"gear_compliance.hpp",
     [] {
       const S back =
           mesh_torque(mesh_torsion(S(20), S(15000), S(0.05)), S(15000), S(0.05), S(0.1)).torque;
       return near(back / S(20), 1) && wave_generator_torsion(S(1), S(100), S(3)) < S(0);
     }},
    {"joint.hpp", [] { return steps(joint(S(2)), 3); }},
    {"lagged_slope.hpp",
     [] {
       typename LaggedSlope<S>::State state;
       for (const S value : {S(1), S(3)}) LaggedSlope<S>::step(state, value, S(1), S(1));
       return near(state.slope, 2);
     }},
    {"math.hpp",
     [] { return near(math::exp(math::log(S(2))), 2) && near(math::tan(math::atan(S(2))), 2); }},
    {"maxwell_slip.hpp",
     [] {
       typename MaxwellSlip<S, 2>::State state;
       for (int k = 0; k < 2; ++k) MaxwellSlip<S, 2>::step(state, S(0.75), S(1));
       return near(MaxwellSlip<S, 2>::shares(state, S(1))[1], 1);
     }},
    {"model.hpp",
     [] {
       S torque = 1;
       return Model<S>{}.predict(moving<S>(), torque) == Status::ok && torque == S(0);
     }},
    {"parameters.hpp",
     [] {
       Count<S> count;
       parameters::visit(count, joint(S(2)));
       return count.total == 14;
     }},
    {"reading_checks.hpp",
     [] {
       typename ReadingChecks<S>::State state;
       Reading<S> in;
       in.period = S(0.001);
       in.sensor_torque = S(9);
       return ReadingChecks<S>::step({.most_sensor_torque = S(8)}, state, in) == Fault::sensor;
     }},
    {"reading_limits.hpp",
     [] {
       Reading<S> in;
       in.sensor_torque = S(1e10);
       bool beyond = false;
       return ReadingLimits<S>{}.take_out(in, beyond) == Fault::sensor && beyond;
     }},
    {"row.hpp", [] { return near(weighted<S, 2>({S(1), S(2)}, {S(3), S(4)}), 11); }},
    {"sample.hpp",
     [] {
       S left = 0;
       for (const Number<S>& each : numbers<S>) left += Sample<S>{}.*each.at;
       return near(left, 25) && !math::is_finite(Reading<S>{}.temperature);
     }},
    {"self_heating.hpp",
     [] {
       S temperature = 25;
       return SelfHeating<S>{S(25), S(2), S(10)}.step(S(3), S(1000), temperature) == Status::ok &&
              near(temperature, 31);
     }},
    {"status.hpp", [] { return extrapolated(S(3), S(1), S(2)) == Flag::extrapolated; }},
    {"swap.hpp",
     [] {
       Swap<Whole<S>> swap(joint(S(0)));
       return swap.load(saved(joint(S(2)))) == BlockStatus::ok && steps(swap.take(), 3);
     }},
    {"torsion.hpp",
     [] {
       const auto gear = Gear<S>::from_ratio(100, OutputSpline::circular, true);
       const auto q = Angle<S>::from_turns(S(0.25));
       return near(mesh_torsion_left(gear, S(100), q, Phase<S>{}, S(0.5)), -0.005);
     }},

    {"effects/catalogue.hpp", [] { return std::tuple_size_v<Effects<S>> > 0; }},
    {"effects/effect.hpp",
     [] { return PhysicalEffect<Offset<S>, S> && !PhysicalEffect<Sample<S>, S>; }},
    {"effects/harmonics.hpp",
     [] {
       const Harmonics<S, 2> two{{{{1, Pair::output_on_housing}, {2, Pair::output_on_housing}}}};
       return near(two.row(Sample<S>{})[2], 1);
     }},

    {"estimators/adaptation.hpp",
     [] {
       using Its = Adaptation<S, 1>;
       typename Its::Config config;
       config.interval = S(0.1L);
       config.memory = S(1);
       config.low = {S(1)};
       config.high = {S(4)};
       config.factor = {S(1)};
       typename Its::State state;
       for (int k = 0; k < 200; ++k) {
         const auto status =
             Its::step(config, state, {S(2)}, {S(0.1L), S(6), S(0), S(1), true, {S(8)}});
         if (status != Status::ok) return false;
       }
       return near(Its::coefficients(state, {S(2)})[0], 2.75);
     }},
    {"estimators/calibration.hpp",
     [] {
       const Calibration<S> line{S(60), S(2)};
       FlaggedTorque<S> out;
       return line.torque(S(0.5), S(1), out) == Status::ok && near(out.torque, 33);
     }},
    {"estimators/chain.hpp",
     [] {
       typename Chain<S>::State state;
       typename Chain<S>::Output out;
       typename Chain<S>::Input in;
       in.period = S(0.001);
       in.motor_torque = S(4);
       AnyStages<S> stages;
       stages.observer = {S(100)};
       stages.observer_input = ObserverInput::motor_torque;
       return Chain<S>::step(stages, state, in, out) == Status::ok && out.missed == Stage::none;
     }},
    {"estimators/collision_detector.hpp",
     [] {
       typename CollisionDetector<S, 1>::State state;
       bool contact = false;
       return CollisionDetector<S, 1>::step({{S(1)}, {S(1)}}, state, S(2), S(0), S(0.001),
                                            contact) == Status::ok &&
              contact;
     }},
    {"estimators/compliance.hpp",
     [] {
       FlaggedTorque<S> out;
       return Compliance<S>{}.torque(S(-1e-3), out) == Status::ok && out.torque > S(0);
     }},
    {"estimators/differentiator.hpp",
     [] {
       typename Differentiator<S>::State state;
       for (const S turns : {S(0), S(0.01)}) {
         const auto at = Angle<S>::from_turns(turns).phase;
         if (Differentiator<S>::step({}, state, at, S(0.001)) != Status::ok) return false;
       }
       return state.velocity > S(0);
     }},
    {"estimators/kalman_merge.hpp", merges<S>},
    {"estimators/load_hysteresis.hpp",
     [] {
       typename LoadHysteresis<S>::State state;
       S left = 0;
       FlaggedTorque<S> out;
       return LoadHysteresis<S>{}.torque(Compliance<S>{}, state, S(-1e-3), left, out) ==
                  Status::ok &&
              out.torque > S(0);
     }},
    {"estimators/logistic_merge.hpp",
     [] { return near(LogisticMerge<S>{}.weight(S(0.001L)), 0.5); }},
    {"estimators/momentum_observer.hpp",
     [] {
       typename MomentumObserver<S>::State state;
       S external = 0;
       for (int k = 0; k < 2; ++k) {
         if (MomentumObserver<S>::step({}, state, S(0), S(3), S(1), external) != Status::ok) {
           return false;
         }
       }
       return near(external, 3);
     }},
    {"estimators/order_tracker.hpp",
     [] {
       using Tracker = OrderTracker<S, 8>;
       typename Tracker::State state;
       const auto config = Tracker::config_of(std::array<std::uint32_t, 1>{2}, 1, 8);
       S torque = 0;
       return Tracker::step(config, state, Phase<S>{}, S(3), torque) == Status::ok &&
              near(torque, 3);
     }},
    {"estimators/preprocessing.hpp",
     [] {
       AnyStages<S> stages;
       stages.checks.emplace().most_sensor_torque = S(8);
       typename Preprocessing<S>::State state;
       typename Chain<S>::Output out;
       Reading<S> in;
       in.period = S(0.001);
       in.sensor_torque = S(9);
       Preprocessing<S>::step(stages, state, in, out);
       return out.faults == Fault::sensor;
     }},
    {"estimators/ripple_oscillator.hpp",
     [] {
       typename RippleOscillator<S, 1>::State state;
       S torque = 0;
       return RippleOscillator<S, 1>::step({}, state, Phase<S>{}, S(3), S(0.001), torque) ==
                  Status::ok &&
              near(torque, 3);
     }},
    {"estimators/stages.hpp",
     [] { return given(AnyStages<S>{}.observer) == nullptr && !NoStages<S>::sensor; }},
    {"estimators/structural_damping.hpp",
     [] {
       typename StructuralDamping<S>::State state;
       S torque = 0;
       return StructuralDamping<S>::step({.initial_torque = S(3)}, state, S(0), S(0.001), torque) ==
                  Status::ok &&
              near(torque, 3);
     }},
    {"estimators/temperature_compensation.hpp",
     [] {
       typename TemperatureCompensation<S, 1>::State state;
       FlaggedTorque<S> out;
       return TemperatureCompensation<S, 1>::step({.coefficients = {S(0.5)}}, state, S(27),
                                                  S(0.001), out) == Status::ok &&
              near(out.torque, 1);
     }},
    {"estimators/thermistor.hpp",
     [] {
       S temperature = 0;
       return Thermistor<S>{}.temperature(S(1.65), temperature) == Status::ok &&
              math::absolute(temperature - S(25)) < S(1e-3);
     }},

    {"sensor/bridge.hpp",
     [] {
       Bridge<S, 4> bridge;
       for (const std::size_t k : {1, 3}) bridge.gauges[k].sign = bridge.gauges[k].arm = S(-1);
       return near(bridge.torque_gain(), 1);
     }},
    {"sensor/electronics.hpp",
     [] {
       typename Conditioning<S>::State state;
       S voltage = 0;
       Flag flags = Flag::none;
       return Conditioning<S>::step({}, state, S(1), S(0.001), voltage, flags) == Status::ok &&
              flags == Flag::saturated;
     }},
};

/// The lines above, and one for each effect of the catalogue, in the header of its name.
template <typename S>
std::vector<Use> uses() {
  std::vector<Use> all = others<S>;
  [&]<typename... Effect>(std::type_identity<std::tuple<Effect...>>) {
    (all.push_back({"effects/" + std::string(Effect::name) + ".hpp", predicts<S, Effect>}), ...);
  }(std::type_identity<Effects<S>>{});
  return all;
}

template <typename S>
bool all_work() {
  bool good = true;
  for (const Use& use : uses<S>()) {
    if (use.works()) continue;
    std::printf("%s: its use here fails\n", use.header.c_str());
    good = false;
  }
  return good;
}

/// Whether the files below a folder are the headers that are used.
bool all_are_used(const std::filesystem::path& folder) {
  std::set<std::string> installed, used;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    installed.insert(entry.path().lexically_relative(folder).generic_string());
  }
  for (const Use& use : uses<double>()) used.insert(use.header);
  for (const auto& header : installed) {
    if (!used.contains(header)) std::printf("%s: installed, not used here\n", header.c_str());
  }
  for (const auto& header : used) {
    if (!installed.contains(header)) std::printf("%s: used here, not installed\n", header.c_str());
  }
  std::printf("%zu headers\n", installed.size());
  return installed == used;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  const bool used = all_are_used(std::filesystem::path(arguments[1]) / "flexspline");
  const bool works = all_work<float>() & all_work<double>();
  return used && works ? 0 : 1;
}
