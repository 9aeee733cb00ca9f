// Everything that a device runs, in both precisions, for a look at the symbols that it needs.
#include "flexspline/effects/catalogue.hpp"
#include "flexspline/estimators/differentiator.hpp"
#include "flexspline/model.hpp"

namespace flexspline {

template <typename S>
struct Joint {
  template <typename... Effects>
  using ModelOf = Model<S, Effects...>;
  using All = Catalogue<ModelOf, S, 12>;
};

template <typename S>
Status step(const typename Joint<S>::All& model, typename Differentiator<S>::State& state,
            Sample<S>& at, S radians, S period, S& torque) noexcept {
  if (const Status read = read_radians(radians, at.output_position); read != Status::ok) {
    return read;
  }
  const Status moved = Differentiator<S>::step({}, state, at.output_position.phase, period);
  if (moved != Status::ok) return moved;
  at.output_velocity = state.velocity;
  at.output_acceleration = state.acceleration;
  return model.predict(at, torque);
}

Status step_float(const Joint<float>::All& model, Differentiator<float>::State& state,
                  Sample<float>& at, float radians, float period, float& torque) noexcept {
  return step<float>(model, state, at, radians, period, torque);
}

Status step_double(const Joint<double>::All& model, Differentiator<double>::State& state,
                   Sample<double>& at, double radians, double period, double& torque) noexcept {
  return step<double>(model, state, at, radians, period, torque);
}

}  // namespace flexspline
