// An exported part's model: channels to what the part says of them.
#include "joint.hpp"
#include "unit.hpp"

namespace {

using Model = joint::Model<unit::Scalar>;

constinit flexspline::Sample<unit::Scalar> at{};
constinit Model::State state{};
constinit unit::Scalar predicted = 0;

template <typename M>
flexspline::Status predict(const M& model, typename M::State& memory) noexcept {
  if constexpr (M::remembers) {
    return model.predict(at, memory, predicted);
  } else {
    return model.predict(at, predicted);
  }
}

}  // namespace

void unit::take(const certify::Row<Scalar>& row) noexcept {
  if ((row.marks & certify::fresh) != 0) state = {};
  at.output_position = {row.turns[0], {row.fractions[0]}};
  at.motor_position = {row.turns[1], {row.fractions[1]}};
  at.known_load = row.known_load;
  for (unsigned k = 0; k < row.numbers.size(); ++k) {
    at.*flexspline::numbers<Scalar>[k].at = row.numbers[k];
  }
}

void unit::give(certify::Result<Scalar>& result) noexcept {
  result = {};
  result.values[0] = predicted;
}

extern "C" [[gnu::flatten]] flexspline::Status flexspline_step() noexcept {
  return predict(joint::model<unit::Scalar>, state);
}
