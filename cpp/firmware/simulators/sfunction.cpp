#include <new>

#include "flexspline-model.hpp"
#include "stepper.hpp"

// Simulink's own headers come last: they define macros of short names.
#define S_FUNCTION_LEVEL 2
#include "simstruc.h"

namespace {

using Stepper = simulators::Stepper<exported::Model<double>>;
constexpr Stepper fresh{exported::model<double>};

constexpr int input_count() noexcept {
  int count = 0;
  for (std::size_t k = 0; k < Stepper::channels; ++k) {
    count += fresh.takes(static_cast<flexspline::Channel>(k)) ? 1 : 0;
  }
  return count;
}
constexpr int inputs = input_count();
constexpr int parts = static_cast<int>(Stepper::parts);
constexpr int outputs = parts > 0 ? 3 : 2;

Stepper* stepper_of(SimStruct* S) noexcept { return static_cast<Stepper*>(ssGetPWorkValue(S, 0)); }

/// The ports' values as the model's inputs; they are in the order of flexspline::Channel.
void take(SimStruct* S, Stepper& stepper) noexcept {
  int port = 0;
  for (std::size_t k = 0; k < Stepper::channels; ++k) {
    const auto channel = static_cast<flexspline::Channel>(k);
    if (fresh.takes(channel)) stepper.input(channel) = *ssGetInputPortRealSignal(S, port++);
  }
}

}  // namespace

static void mdlInitializeSizes(SimStruct* S) {
  ssSetNumSFcnParams(S, 0);
  if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) return;  // Simulink says that
  ssSetNumContStates(S, 0);
  ssSetNumDiscStates(S, 0);
  if (!ssSetNumInputPorts(S, inputs)) return;
  for (int port = 0; port < inputs; ++port) {
    ssSetInputPortWidth(S, port, 1);
    ssSetInputPortRequiredContiguous(S, port, 1);
    ssSetInputPortDirectFeedThrough(S, port, 1);
  }
  if (!ssSetNumOutputPorts(S, outputs)) return;
  ssSetOutputPortWidth(S, 0, 1);
  ssSetOutputPortWidth(S, 1, 1);
  if (parts > 0) ssSetOutputPortWidth(S, 2, parts);
  ssSetNumSampleTimes(S, 1);
  ssSetNumPWork(S, 1);
  ssSetOptions(S, SS_OPTION_EXCEPTION_FREE_CODE);
}

static void mdlInitializeSampleTimes(SimStruct* S) {
  ssSetSampleTime(S, 0, INHERITED_SAMPLE_TIME);
  ssSetOffsetTime(S, 0, 0.0);
}

#define MDL_START
static void mdlStart(SimStruct* S) {
  auto* stepper = new (std::nothrow) Stepper{fresh};
  if (stepper == nullptr) {
    ssSetErrorStatus(S, "there is no memory for what the joint's model remembers");
    return;
  }
  stepper->start(ssGetTStart(S));
  ssSetPWorkValue(S, 0, stepper);
}

// At the start, and where an enabled subsystem starts anew: nothing is remembered.
#define MDL_INITIALIZE_CONDITIONS
static void mdlInitializeConditions(SimStruct* S) {
  if (Stepper* stepper = stepper_of(S); stepper != nullptr) stepper->start(ssGetT(S));
}

static void mdlOutputs(SimStruct* S, int_T) {
  Stepper& stepper = *stepper_of(S);
  take(S, stepper);
  const auto said = stepper.at(ssGetT(S));
  *ssGetOutputPortRealSignal(S, 0) = said.values[0];
  *ssGetOutputPortRealSignal(S, 1) = static_cast<real_T>(said.status);
  if (parts == 0) return;
  real_T* each = ssGetOutputPortRealSignal(S, 2);
  for (std::size_t k = 0; k < Stepper::parts; ++k) each[k] = said.values[k + 1];
}

// In major steps: what effects remember moves on.
#define MDL_UPDATE
static void mdlUpdate(SimStruct* S, int_T) {
  Stepper& stepper = *stepper_of(S);
  take(S, stepper);
  (void)stepper.accept(ssGetT(S));  // its status was an output
}

static void mdlTerminate(SimStruct* S) {
  delete stepper_of(S);
  ssSetPWorkValue(S, 0, nullptr);
}

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
