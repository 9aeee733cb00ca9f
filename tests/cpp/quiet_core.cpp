// Everything that a device runs, in both precisions, for a look at the symbols that it needs.
#include "flexspline/coupling.hpp"
#include "flexspline/effects/catalogue.hpp"
#include "flexspline/estimators/chain.hpp"
#include "flexspline/estimators/differentiator.hpp"
#include "flexspline/estimators/order_tracker.hpp"
#include "flexspline/estimators/preprocessing.hpp"
#include "flexspline/estimators/ripple_oscillator.hpp"
#include "flexspline/joint.hpp"
#include "flexspline/model.hpp"
#include "flexspline/reading_checks.hpp"
#include "flexspline/self_heating.hpp"
#include "flexspline/sensor/bridge.hpp"
#include "flexspline/sensor/electronics.hpp"

namespace flexspline {

template <typename S>
struct Whole {
  template <typename... Effects>
  using ModelOf = Model<S, Effects...>;
  using All = Catalogue<ModelOf, S, 12>;
};

template <typename S>
Status step(const typename Whole<S>::All& model, typename Differentiator<S>::State& state,
            typename Whole<S>::All::State& memory, Sample<S>& at, S radians, S period,
            S& torque) noexcept {
  if (const Status read = read_radians(radians, at.output_position); read != Status::ok) {
    return read;
  }
  const Status moved = Differentiator<S>::step({}, state, at.output_position.phase, period);
  if (moved != Status::ok) return moved;
  at.output_velocity = state.velocity;
  at.output_acceleration = state.acceleration;
  at.period = period;
  return model.predict(at, memory, torque);
}

Status step_float(const Whole<float>::All& model, Differentiator<float>::State& state,
                  Whole<float>::All::State& memory, Sample<float>& at, float radians, float period,
                  float& torque) noexcept {
  return step<float>(model, state, memory, at, radians, period, torque);
}

Status step_double(const Whole<double>::All& model, Differentiator<double>::State& state,
                   Whole<double>::All::State& memory, Sample<double>& at, double radians,
                   double period, double& torque) noexcept {
  return step<double>(model, state, memory, at, radians, period, torque);
}

using Twisted = Model<float, MeshCompliance<float>, TorsionalHysteresis<float>, Backlash<float>>;
Status twisted(const Coupling<float>& coupling, const Twisted& model, float torsion,
               Twisted::State& state, float& torque) noexcept {
  return coupling.torque(model, {}, torsion, state, torque);
}
Status warmed(const SelfHeating<float>& joint, float loss, float period,
              float& temperature) noexcept {
  return joint.step(loss, period, temperature);
}

template <typename S>
using Loaded = Joint<S, Model<S, GainError<S>>, Model<S>, Model<S, Offset<S>>, Model<S>>;
Status step_float(const Loaded<float>& joint, Loaded<float>::State& state, const Reading<float>& in,
                  Chain<float>::Output& out) noexcept {
  return joint.step(state, in, out);
}
Status step_double(const Loaded<double>& joint, Loaded<double>::State& state,
                   const Reading<double>& in, Chain<double>::Output& out) noexcept {
  return joint.step(state, in, out);
}

// All of each stage, whether a joint calls it or not.
#define FLEXSPLINE_STAGES(S)                 \
  template struct Chain<S>;                  \
  template struct Thermistor<S>;             \
  template struct RippleOscillator<S, 3>;    \
  template struct OrderTracker<S, 64>;       \
  template struct ReadingChecks<S>;          \
  template struct Preprocessing<S>;          \
  template struct Bridge<S, 8>;              \
  template struct Conditioning<S>;           \
  template S mesh_torsion(S, S, S) noexcept; \
  template S wave_generator_torsion(S, S, S) noexcept;

FLEXSPLINE_STAGES(float)
FLEXSPLINE_STAGES(double)

#undef FLEXSPLINE_STAGES

}  // namespace flexspline
