// A joint that runs for a long time: soak STEPS, at 1 kHz, in float.
//
// Its velocity and acceleration come from its angle, its readings are checked. It swings forth and
// back, four turns further each 8.192 s, under torques and temperatures that repeat. Over the last
// 20 of these rounds it is compared, output by output, with the same joint started there afresh in
// float (what it carries from the steps before) and in double (that, and float's own rounding); and
// so it was after the first 20. Its harmonics are compared with cosines of exact angles. Ends with
// 1 where the end is worse than the beginning.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "flexspline/effects/catalogue.hpp"
#include "flexspline/joint.hpp"

namespace {

using namespace flexspline;

constexpr std::size_t round_steps = 8192;
constexpr std::uint64_t compared = 20 * round_steps;
constexpr double turn = 6.283185307179586;

template <typename S>
using SensorModel = Model<S, Offset<S>, GainError<S>, OutputRipple<S, 4>, WaveGeneratorRipple<S, 2>,
                          ThermalGradientDrift<S>, TorqueHysteresis<S>>;
template <typename S>
using DriveModel = Model<S, CoulombFriction<S>, ViscousFriction<S>, PreslidingFriction<S>>;
template <typename S>
using TorsionModel = Model<S, Offset<S>, KinematicError<S, 1>>;
template <typename S>
using Whole = Joint<S, SensorModel<S>, DriveModel<S>, TorsionModel<S>, Model<S, Gravity<S>>>;

template <typename S>
constexpr void set_up(typename Chain<S>::Config& sensing, typename Chain<S>::Config& chain) {
  sensing.checks.emplace();
  sensing.checks->most_sensor_torque = S(5);
  sensing.checks->most_speed = S(20);
  sensing.checks->twist = S(0.3L);
  sensing.checks->apart = S(100);
  sensing.checks->gear = Gear<S>::from_ratio(101, OutputSpline::circular, true);
  sensing.differentiator.emplace();
  sensing.sensor = chain.sensor = true;
  sensing.compensation.emplace();
  sensing.compensation->coefficients = {S(0.02), S(-0.001)};
  sensing.compensation->gradient = S(0.05);
  sensing.compensation->thermal_lag = S(5);
  chain.observer = {S(80), Discretisation::exact};
  chain.observer_input = ObserverInput::motor_torque;
  chain.compliance = Compliance<S>{S(15000), S(0.05L), S(0.05L)};
  chain.hysteresis = {S(0.05L), {S(3e-6L), S(2e-6L), S(1e-6L), S(1e-6L)}};
  chain.compliant_observer = {S(60), Discretisation::exact};
  chain.kalman.emplace();
  chain.collision.emplace();
  chain.collision->negative.fill(S(5));
  chain.collision->positive.fill(S(5));
  chain.watched = Watched::merged;
}

template <typename S>
constexpr Whole<S> joint() {
  Whole<S> made{};
  set_up<S>(made.sensing, made.estimating);
  const auto gear = Gear<S>::from_ratio(101, OutputSpline::circular, true);
  const auto fill = [&](auto& model, S scale) {
    model.gear = gear;
    std::apply([&](auto&... part) { (part.coefficients.fill(scale), ...); }, model.parts);
  };
  fill(made.sensor, S(0.05L));
  fill(made.observed, S(0.2L));
  fill(made.torsion, S(1e-3L));
  fill(made.carried, S(0.5));
  std::get<2>(made.sensor.parts)
      .effect.assign(std::array<Harmonic, 4>{{{2, Pair::output_on_housing},
                                              {3, Pair::output_on_housing},
                                              {320, Pair::output_on_housing},
                                              {4200, Pair::output_on_housing}}});
  std::get<3>(made.sensor.parts)
      .effect.assign(std::array<Harmonic, 2>{
          {{2, Pair::wave_generator_on_flexspline}, {4, Pair::wave_generator_on_flexspline}}});
  std::get<4>(made.sensor.parts).effect.thermal_lag = S(5);
  std::get<5>(made.sensor.parts).effect.load_width = S(0.5);  // so that every spring slips
  std::get<1>(made.torsion.parts)
      .effect.assign(std::array<Harmonic, 1>{{{2, Pair::wave_generator_on_flexspline}}});
  made.effective_ratio = S(101);
  made.inertia = S(0.4L);
  made.link_inertia = S(0.3L);
  return made;
}

/// What one round reads, in numbers that a float holds.
struct Round {
  std::vector<std::int64_t> moved;  ///< counts of 2^-32 turns since the round's beginning
  std::vector<float> sensor, motor, temperature;
  std::vector<std::uint32_t> twisted;  ///< of the motor, 2^-32 turns
  std::int64_t whole = 0;              ///< counts of a round

  Round() {
    const double rate = turn / (round_steps * 1e-3);
    for (std::size_t k = 0; k <= round_steps; ++k) {
      const double t = 1e-3 * static_cast<double>(k), angle = rate * t;
      const double q = 4.0 * turn * t / (round_steps * 1e-3) + 7.0 * std::sin(angle);
      moved.push_back(std::llround(q / turn * 4294967296.0));
      sensor.push_back(float(3.0 * std::sin(3 * angle) + 0.7 * std::cos(5 * angle)));
      motor.push_back(float(0.02 + 0.03 * std::sin(2 * angle)));
      temperature.push_back(float(30.0 + 4.0 * std::sin(angle)));
      twisted.push_back(
          static_cast<std::uint32_t>(static_cast<std::int64_t>(1e6 * std::sin(4 * angle))));
    }
    whole = moved.back() + 1'234'567;  // so that no round meets the angles of another
  }
};

/// Reading number k, of which float and double read the same numbers.
template <typename S>
Reading<S> reading(const Round& round, const Gear<float>& gear, std::uint64_t k) {
  const std::size_t at = k % round_steps;
  const std::int64_t counts =
      static_cast<std::int64_t>(k / round_steps) * round.whole + round.moved[at];
  constexpr int spare = 8 * int(sizeof(S)) - 32;
  const auto wide = [](std::uint32_t fraction) {
    return Phase<S>{static_cast<math::Bits<S>>(fraction) << spare};
  };
  const auto turns = static_cast<std::int32_t>(counts >> 32);
  const auto fraction = static_cast<std::uint32_t>(counts);
  const Phase<float> theta = gear.motor_phase({turns, {fraction}});
  Reading<S> in;
  in.period = S(0.001F);
  in.output_position = Angle<S>{turns, wide(fraction)};
  in.motor_position = Angle<S>{0, wide(theta.fraction + round.twisted[at])};
  in.sensor_torque = S(round.sensor[at]);
  in.motor_torque = S(round.motor[at]);
  in.temperature = S(round.temperature[at]);
  return in;
}

template <typename S>
struct Device {
  static constexpr Whole<S> made = joint<S>();
  typename Whole<S>::State state{};
  typename Whole<S>::Chain::Output out{};

  int calm = 0;  ///< steps since the start, which the differentiator misses 56 of

  [[gnu::flatten]] void step(const Reading<S>& in) {
    const bool done = made.step(state, in, out) == Status::ok && out.faults == Fault::none;
    if (calm < 60) ++calm;
    if (!done || (calm == 60 && out.missed != Stage::none)) {
      std::puts("a step failed");
      std::exit(1);
    }
  }
};

/// Largest differences in the last round, Nm: sensor, observer, compliance, observer of the link,
/// merged.
struct Apart {
  double values[5]{};

  template <typename S>
  void look(const typename Chain<float>::Output& a, const typename Chain<S>::Output& b) {
    const double pairs[5][2]{
        {double(a.external_sensor), double(b.external_sensor)},
        {double(a.external_observer), double(b.external_observer)},
        {double(a.external_compliance), double(b.external_compliance)},
        {double(a.external_compliant_observer), double(b.external_compliant_observer)},
        {double(a.external_merged), double(b.external_merged)}};
    for (int k = 0; k < 5; ++k) {
      values[k] = std::fmax(values[k], std::fabs(pairs[k][0] - pairs[k][1]));
    }
  }
  void print(const char* name) const {
    std::printf("%-32s %.2g %.2g %.2g %.2g %.2g Nm\n", name, values[0], values[1], values[2],
                values[3], values[4]);
  }
};

struct Compared {
  Apart fresh, exact;
};

Compared compare(Device<float>& long_runner, const Round& round, std::uint64_t& k) {
  Device<float> fresh;
  Device<double> exact;
  Compared found;
  const Gear<float> gear = long_runner.made.torsion.gear;
  for (std::uint64_t step = 0; step < compared; ++step, ++k) {
    const Reading<float> in = reading<float>(round, gear, k);
    long_runner.step(in);
    fresh.step(in);
    exact.step(reading<double>(round, gear, k));
    if (step + round_steps < compared) continue;
    found.fresh.look<float>(long_runner.out, fresh.out);
    found.exact.look<double>(long_runner.out, exact.out);
  }
  return found;
}

/// Largest error of a harmonic of order 4200 against the cosine of its exact angle, over a round.
double phase_error(const Round& round, const Gear<float>& gear, std::uint64_t k) {
  OutputRipple<float, 1> ripple;
  ripple.assign(std::array<Harmonic, 1>{{{4200, Pair::output_on_housing}}});
  double worst = 0;
  for (std::uint64_t step = k - round_steps; step < k; ++step) {
    Sample<float> at;
    at.output_position = *reading<float>(round, gear, step).output_position;
    const std::uint32_t fraction = 4200U * at.output_position.phase.fraction;
    const double angle = turn * static_cast<double>(fraction) / 4294967296.0;
    worst = std::fmax(worst, std::fabs(double(ripple.row(at)[0]) - std::cos(angle)));
  }
  return worst;
}

/// Prints both comparisons; whether the end is as good as the beginning.
bool report(const Compared& first, const Compared& last, double phase) {
  first.fresh.print("from a fresh start, at first");
  last.fresh.print("from a fresh start, at the end");
  first.exact.print("from double, at first");
  last.exact.print("from double, at the end");
  std::printf("order 4200 from its exact angle: %.2g\n", phase);
  bool good = phase < 3e-7;
  for (int j = 0; j < 5; ++j) {
    good = good && last.exact.values[j] <= 1.5 * first.exact.values[j];
    good = good && last.fresh.values[j] <= first.fresh.values[j] + first.exact.values[j];
  }
  return good;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  const std::uint64_t steps = std::strtoull(arguments[1], nullptr, 10);
  const Round round;
  Device<float> device;
  const Gear<float> gear = device.made.torsion.gear;
  std::uint64_t k = 0;
  while (k < compared) device.step(reading<float>(round, gear, k++));
  const Compared first = compare(device, round, k);
  while (k + compared < steps) device.step(reading<float>(round, gear, k++));
  const Compared last = compare(device, round, k);
  std::printf("%llu steps; largest differences of sensor, observer, compliance, link, merged\n",
              static_cast<unsigned long long>(k));
  return report(first, last, phase_error(round, gear, k)) ? 0 : 1;
}
