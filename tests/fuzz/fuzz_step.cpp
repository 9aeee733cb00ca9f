// Any bits as readings of a joint with every stage and effect: two bytes of choices, one of the
// precision and of checking readings first, then readings (step_invariants.hpp). Behind them a calm
// stretch must bring every stage back.
#include "flexspline/reading_checks.hpp"
#include "step_invariants.hpp"
#include "whole_joint.hpp"

namespace {

using namespace flexspline;
using namespace flexspline::fuzz;

constexpr int recovery = 3000;  // calm steps of 1 ms until nothing is missed

template <typename S>
struct Checked {
  using Checks = ReadingChecks<S>;
  typename Checks::Config limits;
  typename Checks::State state;

  Checked() {
    limits.least_voltage = S(-2);
    limits.most_voltage = S(2);
    limits.most_sensor_torque = limits.most_motor_torque = S(100);
    limits.most_speed = S(10);
    limits.most_acceleration = S(1000);
    limits.way = S(0.02);
    limits.twist = S(1);
    limits.gear = Gear<S>::from_ratio(101.0, OutputSpline::circular, true);
  }

  /// Takes out what cannot be true: each value is then the one before, or missing.
  void take_out(Reading<S>& in) {
    const Reading<S> before = in;
    const Fault found = Checks::step(limits, state, in);
    for (auto field :
         {&Reading<S>::output_velocity, &Reading<S>::output_acceleration, &Reading<S>::motor_torque,
          &Reading<S>::sensor_voltage, &Reading<S>::sensor_torque}) {
      const bool same = same_bytes(in.*field, before.*field);
      require(same || (found != Fault::none && in.*field != in.*field), "checks change no value");
    }
    require(math::is_finite(state.astray) && math::is_finite(state.twisted), "checks are finite");
  }
};

template <typename S>
void run_checked(const WholeJoint<S>& joint, typename WholeJoint<S>::State& state,
                 typename WholeJoint<S>::Chain::Output& out, Source& source) {
  Checked<S> checks;
  for (int k = 0; !source.empty(); ++k) {
    Reading<S> in = any_reading<S>(source, k);
    checks.take_out(in);
    checked_step<S>(joint, state, in, out);
  }
}

template <typename S>
void run(std::uint16_t choice, bool checked, Source& source) {
  const WholeJoint<S> joint = whole_joint<S>(choice);
  typename WholeJoint<S>::State state;
  typename WholeJoint<S>::Chain::Output out;
  if (checked) {
    run_checked(joint, state, out, source);
  } else {
    checked_run<S>(joint, state, out, source);
  }
  int k = 0;
  do {
    require(joint.step(state, calm_reading<S>(k), out) == Status::ok, "a calm step is ok");
    require(++k <= recovery, "every stage comes back");
  } while (out.missed != Stage::none);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  const auto choice = source.take<std::uint16_t>();
  const auto how = source.take<std::uint8_t>();
  if ((how & 1) != 0) {
    run<double>(choice, (how & 2) != 0, source);
  } else {
    run<float>(choice, (how & 2) != 0, source);
  }
  return 0;
}
