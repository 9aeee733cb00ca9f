// Any bits as readings of a joint with every stage and effect: two bytes of choices, one of the
// precision, then readings (step_invariants.hpp). Behind them a calm stretch must bring every stage
// back.
#include "step_invariants.hpp"
#include "whole_joint.hpp"

namespace {

using namespace flexspline;
using namespace flexspline::fuzz;

constexpr int recovery = 3000;  // calm steps of 1 ms until nothing is missed

template <typename S>
void run(std::uint16_t choice, Source& source) {
  const WholeJoint<S> joint = whole_joint<S>(choice);
  typename WholeJoint<S>::State state;
  typename WholeJoint<S>::Chain::Output out;
  checked_run<S>(joint, state, out, source);
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
    run<double>(choice, source);
  } else {
    run<float>(choice, source);
  }
  return 0;
}
