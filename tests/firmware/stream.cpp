// A device in a pipe: samples in, torques out, one at a time, through an exported header.
//
//   stream float|double radians|fractions [model] < rows > results
//
// `MODELS(X)` is X of the name of each exported header (of its namespace), all of which `models.hpp`
// includes; without it there is `joint.hpp` alone.
//
// Rows are those of rows.hpp; angles are radians and nothing, or turns and a fraction in 2^-32
// turns, as an encoder counts. A result is two doubles: torque and status.
#include <array>
#include <cstdio>
#include <cstring>

#if __has_include("models.hpp")
#include "models.hpp"
#else
#include "joint.hpp"
#define MODELS(X) X(joint)
#endif
#include "rows.hpp"

namespace {

using flexspline::Angle;
using flexspline::Sample;
using flexspline::Status;

template <typename S>
Status read_fractions(const double* in, Angle<S>& angle) noexcept {
  constexpr int spare = 8 * int(sizeof(S)) - 32;
  const auto fraction = static_cast<flexspline::math::Bits<S>>(in[1]) << spare;
  angle = {static_cast<std::int32_t>(in[0]), {fraction}};
  return Status::ok;
}

template <typename S, typename Model>
Status predict(const Model& model, const Sample<S>& at, typename Model::State& state,
               S& torque) noexcept {
  if constexpr (Model::remembers) {
    return model.predict(at, state, torque);
  } else {
    return model.predict(at, torque);
  }
}

template <typename S, typename Model>
int stream(const Model& model, bool radians) noexcept {
  const auto read_angle = [radians](const double* in, Angle<S>& angle) noexcept {
    return radians ? flexspline::read_radians(static_cast<S>(in[0]), angle)
                   : read_fractions(in, angle);
  };
  Sample<S> at;
  S torque = S(0);
  typename Model::State state;
  std::array<double, 11> row{};
  while (std::fread(row.data(), sizeof row, 1, stdin) == 1) {
    Status status = read_angle(&row[0], at.output_position);
    if (status == Status::ok) status = read_angle(&row[2], at.motor_position);
    read_numbers(row, at);
    if (at.period == S(0)) {
      state = {};
      at.period = S(0.5);  // a device has some period; where it starts anew any will do
    }
    if (status == Status::ok) status = predict(model, at, state, torque);
    const std::array<double, 2> result{static_cast<double>(torque), static_cast<double>(status)};
    if (std::fwrite(result.data(), sizeof result, 1, stdout) != 1) return 1;
  }
  return 0;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3 && count != 4) return 2;
  const bool radians = std::strcmp(arguments[2], "radians") == 0;
  const bool single = std::strcmp(arguments[1], "float") == 0;
#define STREAM(name)                                              \
  if (count == 3 || std::strcmp(arguments[3], #name) == 0) {      \
    return single ? stream<float>(name::model<float>, radians)    \
                  : stream<double>(name::model<double>, radians); \
  }
  MODELS(STREAM)
  return 2;
}
