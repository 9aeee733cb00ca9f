/// A joint over a log has the bits of the joint on a device: all effects, all stages, all choices.
#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "../fuzz/whole_joint.hpp"
#include "host/by_name.hpp"
#include "host/replay_joint.hpp"
#include "random_samples.hpp"

using namespace flexspline;

namespace {

constexpr std::size_t rows = 1300;  // a full block and a part of one
constexpr std::array<std::size_t, 2> starts{0, 700};
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// A swinging joint whose channels have holes, infinities and numbers that the checks take out.
struct Holes {
  std::vector<double> time, q, theta;
  std::array<std::vector<double>, batch::reading_numbers.size()> numbers;

  explicit Holes(unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const auto hole = [&random](double value) {
      const auto what = random() % 40;
      return what == 0 ? nothing : what == 1 ? std::numeric_limits<double>::infinity() : value;
    };
    constexpr std::array<double, 9> sizes{0.5, 3, 5, 0.4, 0, 0, 0.01, 0.5, 20};
    constexpr std::array<double, 9> middles{0, 0, 30, 0, 0, 0, 1.4, 0, 0};
    for (std::size_t i = 0; i < rows; ++i) {
      const double t = 0.001 * static_cast<double>(i);
      time.push_back(i % 97 == 50 ? time.back() : t + (i >= starts[1] ? 5.0 : 0.0));
      q.push_back(hole(0.5 * std::sin(3 * t)));
      theta.push_back(hole(101 * 0.5 * std::sin(3 * t) + 0.01 * normal(random)));
      for (std::size_t k = 0; k < numbers.size(); ++k) {
        numbers[k].push_back(hole(middles[k] + sizes[k] * normal(random)));
      }
    }
  }

  batch::JointLog log() const {
    batch::JointLog made{rows, starts, time.data(), q.data(), theta.data()};
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      const bool clock = batch::of_the_clock(batch::reading_numbers[k].name);
      if (!clock) made.numbers[k] = numbers[k].data();
    }
    return made;
  }
};

template <typename Effect>
batch::AnyEffect any_of(const Effect& effect) {
  batch::AnyEffect any = batch::effect_by_name(Effect::name);
  if constexpr (requires { Effect::shapes(); }) {
    for (const auto& shape : Effect::shapes())
      batch::set_shape(any, shape.name, effect.*shape.field);
  }
  if constexpr (HarmonicEffect<Effect>) batch::set_harmonics(any, effect.harmonics());
  return any;
}

template <typename... Effects>
batch::AnyModel any_of(const Model<double, Effects...>& model) {
  std::vector<batch::AnyEffect> effects;
  std::vector<double> coefficients;
  const auto take = [&](const auto& part) {
    effects.push_back(any_of(part.effect));
    coefficients.insert(coefficients.end(), part.coefficients.begin(), part.coefficients.end());
  };
  std::apply([&](const auto&... part) { (take(part), ...); }, model.parts);
  return {batch::Design(std::move(effects), model.gear), coefficients};
}

using Device = fuzz::WholeJoint<double>;

batch::LogJoint any_of(const Device& joint) {
  return {.sensing = joint.sensing,
          .estimating = joint.estimating,
          .sensor = any_of(joint.sensor),
          .observed = any_of(joint.observed),
          .torsion = any_of(joint.torsion),
          .carried = any_of(joint.carried),
          .effective_ratio = joint.effective_ratio,
          .inertia = joint.inertia,
          .link_inertia = joint.link_inertia,
          .low = joint.low,
          .high = joint.high};
}

/// All results of a run.
struct Results {
  std::array<std::vector<double>, 2> sensed;
  std::array<std::vector<double>, batch::joint_outputs.size()> outputs;
  std::array<std::vector<double>, batch::joint_inputs.size()> inputs;
  std::vector<std::uint8_t> contact, flags, faults;
  std::vector<std::uint16_t> missed;
  std::vector<Device::Adapting::Numbers> adapted;

  explicit Results(std::size_t size)
      : contact(size), flags(size), faults(size), missed(size), adapted(size) {
    for (auto& column : sensed) column.resize(size);
    for (auto& column : outputs) column.resize(size);
    for (auto& column : inputs) column.resize(size);
  }
  batch::JointResults columns() {
    batch::JointResults made{sensed[0].data(), sensed[1].data()};
    for (std::size_t k = 0; k < outputs.size(); ++k) made.outputs[k] = outputs[k].data();
    for (std::size_t k = 0; k < inputs.size(); ++k) made.inputs[k] = inputs[k].data();
    made.contact = contact.data();
    made.flags = flags.data();
    made.faults = faults.data();
    made.missed = missed.data();
    made.adapted = adapted.front().data();
    return made;
  }
};

/// Whether a value of a log has the bits of the device's, NaN where that missed it.
bool same(double of_log, double of_device, bool known) {
  if (!known || !math::is_finite(of_device)) return std::isnan(of_log);
  return same_bits(of_log, of_device);
}

/// How many estimates there were.
std::size_t check_alike(const Device& device, const Holes& holes) {
  Results found(rows);
  const batch::LogJoint joint = any_of(device);
  batch::replay_joint(joint, holes.log(), found.columns());
  std::size_t estimates = 0;
  Device::Chain::Output out;
  Device::Trace trace;
  Device::State state;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const std::size_t first = starts[k], last = k + 1 < starts.size() ? starts[k + 1] : rows;
    Device::restart(state);
    batch::replay(holes.time.data() + first, last - first, [&](std::size_t i, double period) {
      const std::size_t row = first + i;
      const auto in = batch::reading_of(holes.log(), row, period);
      const Status status = device.step(state, in, out, trace);
      const bool good = status == Status::ok;
      CHECK((good ? static_cast<std::uint16_t>(out.missed) : found.missed[row]) ==
            found.missed[row]);
      CHECK((good ? static_cast<std::uint8_t>(out.flags) : 0) == found.flags[row]);
      CHECK((good ? static_cast<std::uint8_t>(out.faults) : 0) == found.faults[row]);
      CHECK(same(found.sensed[1][row], trace.sensed.torque, good));
      for (std::size_t o = 0; o < found.outputs.size(); ++o) {
        const auto& output = batch::joint_outputs[o];
        const bool known = good && !has(out.missed, output.by);
        estimates += std::isfinite(found.outputs[o][row]) ? 1 : 0;
        if (!has(batch::configured(joint.estimating), output.by)) continue;
        CHECK(same(found.outputs[o][row], out.*output.field, known));
      }
      for (std::size_t n = 0; n < found.inputs.size(); ++n) {
        CHECK(same(found.inputs[n][row], trace.input.*batch::joint_inputs[n].field, good));
      }
      CHECK(found.adapted[row] == device.adapted(state));
      if (good && !has(out.missed, Stage::collision)) CHECK(out.contact == found.contact[row]);
      return status;
    });
  }
  return estimates;
}

}  // namespace

TEST_CASE("a joint over a log has the bits of the joint on a device, whatever it is made of") {
  const Holes holes(3);
  std::mt19937_64 random(5);
  std::size_t total = 0;
  for (int run = 0; run < 40; ++run) {
    const auto choice = static_cast<std::uint16_t>(random() & 32767);
    CAPTURE(choice);
    const std::size_t estimates = check_alike(fuzz::whole_joint<double>(choice), holes);
    CHECK(estimates > 300);
    total += estimates;
  }
  CHECK(total > 40 * rows);
}

TEST_CASE("a model of the same effects has the bits of its type, sample by sample") {
  const Device device = fuzz::whole_joint<double>(0);
  std::mt19937_64 random(7);
  batch::AnyModel any = any_of(device.observed);
  auto there = any.start();
  decltype(device.observed)::State here;
  for (int i = 0; i < 300; ++i) {
    const auto at = usual_sample<double>(random);
    CHECK(same_bits(any.torque(at, there), device.observed.torque(at, here)));
  }
}

TEST_CASE("a model without effects says zero") {
  batch::AnyModel none;
  auto state = none.start();
  CHECK(none.torque({}, state) == 0.0);
}

TEST_CASE("an infinite velocity is missing for a model that looks ahead too") {
  const std::vector<double> coefficients{1.0, 0.0};
  const batch::AnyEffect coulomb = batch::effect_by_name("coulomb_friction");
  batch::LogJoint joint;
  joint.estimating.observer = {100.0};
  joint.estimating.observer_input = ObserverInput::motor_torque;
  joint.observed = batch::AnyModel(batch::Design({coulomb}, Gear<double>{}),
                                   std::span(coefficients).first(batch::terms_of(coulomb)));
  const std::array<double, 3> time{0, 0.001, 0.002}, torque{1, 1, 1};
  const std::array<double, 3> velocity{1, std::numeric_limits<double>::infinity(), 1};
  const std::array<std::size_t, 1> one{0};
  batch::JointLog log{3, one, time.data()};
  log.numbers[batch::place_of_reading("output_velocity")] = velocity.data();
  log.numbers[batch::place_of_reading("motor_torque")] = torque.data();
  Results found(3);
  batch::replay_joint(joint, log, found.columns());
  CHECK(found.missed == std::vector<std::uint16_t>{0, 8, 0});
}
