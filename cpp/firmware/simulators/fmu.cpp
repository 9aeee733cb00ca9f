// An exported model as a co-simulation FMU of FMI 3.0 ([Modelica2022], chapters 2 and 4).
//
// Value references: 0 is the time, 1 + c the input of the channel number c (flexspline::Channel),
// 64 the modelled torque, 65 its status, 128 + k what effect number k adds. modelDescription.xml
// has those that the model has.
//
// In Step Mode outputs are those of the inputs at the present time, as they are set. fmi3DoStep
// takes the inputs for those of the step's beginning: what effects remember moves on, and time to
// the step's end, to which inputs hold.
#include <cstdlib>
#include <cstring>
#include <new>
#include <type_traits>

#include "flexspline-model.hpp"
#include "fmi3.hpp"
#include "stepper.hpp"

namespace {

using Model = exported::Model<double>;
using Stepper = simulators::Stepper<Model>;
using flexspline::Channel;
using flexspline::Status;

enum Reference : fmi3ValueReference { time = 0, inputs = 1, torque = 64, status = 65, parts = 128 };
static_assert(inputs + Stepper::channels <= torque);

enum class Mode { instantiated, initialization, step, terminated };

struct Instance {
  Stepper stepper{exported::model<double>};
  double time = 0;
  Mode mode = Mode::instantiated;
  bool logging = false;
  fmi3InstanceEnvironment environment = nullptr;
  fmi3LogMessageCallback log = nullptr;
};
static_assert(std::is_trivially_destructible_v<Instance>);

Instance& of(fmi3Instance instance) noexcept { return *static_cast<Instance*>(instance); }

fmi3Status said(const Instance& in, fmi3Status status, const char* message) noexcept {
  const char* category = status == fmi3Warning ? "logStatusWarning" : "logStatusError";
  if (in.logging && in.log != nullptr) in.log(in.environment, status, category, message);
  return status;
}
fmi3Status refused(fmi3Instance instance, const char* message) noexcept {
  return said(of(instance), fmi3Error, message);
}

const char* words(Status found) noexcept {
  switch (found) {
    case Status::not_finite:
      return "an input is not finite: outputs keep their last good values";
    case Status::bad_period:
      return "time goes back, or by more than an hour";
    case Status::out_of_range:
      return "an input is beyond what a joint has";
    case Status::ok:
      break;
  }
  return "";
}

/// The input of a value reference; null where there is none.
double* input(Instance& in, fmi3ValueReference reference) noexcept {
  if (reference < inputs || reference >= inputs + Stepper::channels) return nullptr;
  const auto channel = static_cast<Channel>(reference - inputs);
  return in.stepper.takes(channel) ? &in.stepper.input(channel) : nullptr;
}

/// Whether the token is that of modelDescription.xml: "target:SHA-256 of the model".
bool is_token(fmi3String token) noexcept {
  constexpr std::size_t head = exported::target.size();
  if (token == nullptr || std::strlen(token) != head + 1 + exported::model_sha256.size())
    return false;
  return std::strncmp(token, exported::target.data(), head) == 0 && token[head] == ':' &&
         exported::model_sha256 == token + head + 1;
}

}  // namespace

extern "C" {

// Every instance.

FMI3_Export const char* FMI3_NAME(fmi3GetVersion)() { return "3.0"; }

FMI3_Export fmi3Status FMI3_NAME(fmi3SetDebugLogging)(fmi3Instance instance, fmi3Boolean on,
                                                      std::size_t, const fmi3String[]) {
  of(instance).logging = on;
  return fmi3OK;
}

FMI3_Export fmi3Instance FMI3_NAME(fmi3InstantiateCoSimulation)(
    fmi3String, fmi3String token, fmi3String, fmi3Boolean, fmi3Boolean logging, fmi3Boolean,
    fmi3Boolean, const fmi3ValueReference[], std::size_t, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback) {
  if (!is_token(token)) {
    if (log != nullptr) {
      log(environment, fmi3Error, "logStatusError",
          "the instantiationToken is that of another model; take the modelDescription.xml beside");
    }
    return nullptr;
  }
  void* room = std::malloc(sizeof(Instance));
  if (room == nullptr) return nullptr;
  auto* in = new (room) Instance;
  in->logging = logging;
  in->environment = environment;
  in->log = log;
  return in;
}

FMI3_Export fmi3Instance FMI3_NAME(fmi3InstantiateModelExchange)(fmi3String, fmi3String, fmi3String,
                                                                 fmi3Boolean, fmi3Boolean,
                                                                 fmi3InstanceEnvironment,
                                                                 fmi3LogMessageCallback) {
  return nullptr;
}

FMI3_Export fmi3Instance FMI3_NAME(fmi3InstantiateScheduledExecution)(
    fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean, fmi3InstanceEnvironment,
    fmi3LogMessageCallback, fmi3ClockUpdateCallback, fmi3LockPreemptionCallback,
    fmi3UnlockPreemptionCallback) {
  return nullptr;
}

FMI3_Export void FMI3_NAME(fmi3FreeInstance)(fmi3Instance instance) { std::free(instance); }

FMI3_Export fmi3Status FMI3_NAME(fmi3EnterInitializationMode)(fmi3Instance instance, fmi3Boolean,
                                                              fmi3Float64, fmi3Float64 start,
                                                              fmi3Boolean, fmi3Float64) {
  Instance& in = of(instance);
  if (in.mode != Mode::instantiated)
    return refused(instance, "it is initialized already; reset it");
  if (!flexspline::math::is_finite(start)) return refused(instance, "the start is not finite");
  in.time = start;
  in.stepper.start(start);
  in.mode = Mode::initialization;
  return fmi3OK;
}

FMI3_Export fmi3Status FMI3_NAME(fmi3ExitInitializationMode)(fmi3Instance instance) {
  Instance& in = of(instance);
  if (in.mode != Mode::initialization) return refused(instance, "it is not being initialized");
  in.mode = Mode::step;
  return fmi3OK;
}

FMI3_Export fmi3Status FMI3_NAME(fmi3Terminate)(fmi3Instance instance) {
  of(instance).mode = Mode::terminated;
  return fmi3OK;
}

FMI3_Export fmi3Status FMI3_NAME(fmi3Reset)(fmi3Instance instance) {
  Instance& in = of(instance);
  in.stepper = Stepper{exported::model<double>};
  in.time = 0;
  in.mode = Mode::instantiated;
  return fmi3OK;
}

// Steps and values.

FMI3_Export fmi3Status FMI3_NAME(fmi3DoStep)(fmi3Instance instance, fmi3Float64 now,
                                             fmi3Float64 step, fmi3Boolean, fmi3Boolean* event,
                                             fmi3Boolean* terminate, fmi3Boolean* early,
                                             fmi3Float64* reached) {
  Instance& in = of(instance);
  if (in.mode != Mode::step) return refused(instance, "it is not in Step Mode");
  const double end = now + step;
  if (!flexspline::math::is_finite(now) || !(end > now) || !flexspline::math::is_finite(end)) {
    return refused(instance, "a step is to have a finite begin and to be longer than zero");
  }
  const Status found = in.stepper.accept(now);
  in.time = end;
  *event = *terminate = *early = false;
  *reached = end;
  return found == Status::ok ? fmi3OK : said(in, fmi3Warning, words(found));
}

FMI3_Export fmi3Status FMI3_NAME(fmi3GetFloat64)(fmi3Instance instance,
                                                 const fmi3ValueReference references[],
                                                 std::size_t count, fmi3Float64 values[],
                                                 std::size_t size) {
  Instance& in = of(instance);
  if (count != size) return refused(instance, "there is not one value for each reference");
  const auto found = in.stepper.at(in.time);
  for (std::size_t k = 0; k < count; ++k) {
    const fmi3ValueReference reference = references[k];
    if (reference == time) {
      values[k] = in.time;
    } else if (const double* value = input(in, reference); value != nullptr) {
      values[k] = *value;
    } else if (reference == torque) {
      values[k] = found.values[0];
    } else if (reference >= parts && reference - parts < Stepper::parts) {
      values[k] = found.values[reference - parts + 1];
    } else {
      return refused(instance, "there is no Float64 of this value reference");
    }
  }
  return fmi3OK;
}

FMI3_Export fmi3Status FMI3_NAME(fmi3SetFloat64)(fmi3Instance instance,
                                                 const fmi3ValueReference references[],
                                                 std::size_t count, const fmi3Float64 values[],
                                                 std::size_t size) {
  Instance& in = of(instance);
  if (count != size) return refused(instance, "there is not one value for each reference");
  if (in.mode == Mode::terminated) return refused(instance, "it is terminated; reset it");
  for (std::size_t k = 0; k < count; ++k) {
    if (input(in, references[k]) == nullptr) {
      return refused(instance, "there is no input of this value reference");
    }
  }
  for (std::size_t k = 0; k < count; ++k) *input(in, references[k]) = values[k];
  return fmi3OK;
}

FMI3_Export fmi3Status FMI3_NAME(fmi3GetInt64)(fmi3Instance instance,
                                               const fmi3ValueReference references[],
                                               std::size_t count, fmi3Int64 values[],
                                               std::size_t size) {
  Instance& in = of(instance);
  if (count != size) return refused(instance, "there is not one value for each reference");
  for (std::size_t k = 0; k < count; ++k) {
    if (references[k] != status) return refused(instance, "the status alone is an integer");
    values[k] = static_cast<fmi3Int64>(in.stepper.at(in.time).status);
  }
  return fmi3OK;
}

// What there is none of: values of other types, events, clocks, states to save, derivatives, and
// what belongs to other kinds of FMUs. Importers look for all of FMI's functions.

#define FMI3_NONE(Type)                                                                          \
  FMI3_Export fmi3Status FMI3_NAME(fmi3Get##Type)(fmi3Instance instance,                         \
                                                  const fmi3ValueReference[], std::size_t count, \
                                                  fmi3##Type[], std::size_t) {                   \
    return count == 0 ? fmi3OK : refused(instance, "there is no value of the type " #Type);      \
  }                                                                                              \
  FMI3_SETTER_NONE(Type)
#define FMI3_SETTER_NONE(Type)                                                                   \
  FMI3_Export fmi3Status FMI3_NAME(fmi3Set##Type)(fmi3Instance instance,                         \
                                                  const fmi3ValueReference[], std::size_t count, \
                                                  const fmi3##Type[], std::size_t) {             \
    return count == 0 ? fmi3OK : refused(instance, "there is no input of the type " #Type);      \
  }

FMI3_NONE(Float32)
FMI3_NONE(Int8)
FMI3_NONE(UInt8)
FMI3_NONE(Int16)
FMI3_NONE(UInt16)
FMI3_NONE(Int32)
FMI3_NONE(UInt32)
FMI3_SETTER_NONE(Int64)
FMI3_NONE(UInt64)
FMI3_NONE(Boolean)
FMI3_NONE(String)

#define FMI3_REFUSED(name, ...)                                                \
  FMI3_Export fmi3Status FMI3_NAME(name)(fmi3Instance instance, __VA_ARGS__) { \
    return refused(instance, #name " is not supported");                       \
  }
#define FMI3_REFUSED_MODE(name)                                   \
  FMI3_Export fmi3Status FMI3_NAME(name)(fmi3Instance instance) { \
    return refused(instance, #name " is not supported");          \
  }

FMI3_REFUSED(fmi3GetBinary, const fmi3ValueReference[], std::size_t, std::size_t[], fmi3Binary[],
             std::size_t)
FMI3_REFUSED(fmi3SetBinary, const fmi3ValueReference[], std::size_t, const std::size_t[],
             const fmi3Binary[], std::size_t)
FMI3_REFUSED(fmi3GetClock, const fmi3ValueReference[], std::size_t, fmi3Clock[])
FMI3_REFUSED(fmi3SetClock, const fmi3ValueReference[], std::size_t, const fmi3Clock[])
FMI3_REFUSED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference, std::size_t*)
FMI3_REFUSED(fmi3GetVariableDependencies, fmi3ValueReference, std::size_t[], fmi3ValueReference[],
             std::size_t[], fmi3DependencyKind[], std::size_t)
FMI3_REFUSED(fmi3GetFMUState, fmi3FMUState*)
FMI3_REFUSED(fmi3SetFMUState, fmi3FMUState)
FMI3_REFUSED(fmi3FreeFMUState, fmi3FMUState*)
FMI3_REFUSED(fmi3SerializedFMUStateSize, fmi3FMUState, std::size_t*)
FMI3_REFUSED(fmi3SerializeFMUState, fmi3FMUState, fmi3Byte[], std::size_t)
FMI3_REFUSED(fmi3DeserializeFMUState, const fmi3Byte[], std::size_t, fmi3FMUState*)
FMI3_REFUSED(fmi3GetDirectionalDerivative, const fmi3ValueReference[], std::size_t,
             const fmi3ValueReference[], std::size_t, const fmi3Float64[], std::size_t,
             fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetAdjointDerivative, const fmi3ValueReference[], std::size_t,
             const fmi3ValueReference[], std::size_t, const fmi3Float64[], std::size_t,
             fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetOutputDerivatives, const fmi3ValueReference[], std::size_t, const fmi3Int32[],
             fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetIntervalDecimal, const fmi3ValueReference[], std::size_t, fmi3Float64[],
             fmi3IntervalQualifier[])
FMI3_REFUSED(fmi3GetIntervalFraction, const fmi3ValueReference[], std::size_t, fmi3UInt64[],
             fmi3UInt64[], fmi3IntervalQualifier[])
FMI3_REFUSED(fmi3GetShiftDecimal, const fmi3ValueReference[], std::size_t, fmi3Float64[])
FMI3_REFUSED(fmi3GetShiftFraction, const fmi3ValueReference[], std::size_t, fmi3UInt64[],
             fmi3UInt64[])
FMI3_REFUSED(fmi3SetIntervalDecimal, const fmi3ValueReference[], std::size_t, const fmi3Float64[])
FMI3_REFUSED(fmi3SetIntervalFraction, const fmi3ValueReference[], std::size_t, const fmi3UInt64[],
             const fmi3UInt64[])
FMI3_REFUSED(fmi3SetShiftDecimal, const fmi3ValueReference[], std::size_t, const fmi3Float64[])
FMI3_REFUSED(fmi3SetShiftFraction, const fmi3ValueReference[], std::size_t, const fmi3UInt64[],
             const fmi3UInt64[])
FMI3_REFUSED(fmi3UpdateDiscreteStates, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*,
             fmi3Boolean*, fmi3Float64*)
FMI3_REFUSED(fmi3CompletedIntegratorStep, fmi3Boolean, fmi3Boolean*, fmi3Boolean*)
FMI3_REFUSED(fmi3SetTime, fmi3Float64)
FMI3_REFUSED(fmi3SetContinuousStates, const fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetContinuousStateDerivatives, fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetEventIndicators, fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetContinuousStates, fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetNominalsOfContinuousStates, fmi3Float64[], std::size_t)
FMI3_REFUSED(fmi3GetNumberOfEventIndicators, std::size_t*)
FMI3_REFUSED(fmi3GetNumberOfContinuousStates, std::size_t*)
FMI3_REFUSED(fmi3ActivateModelPartition, fmi3ValueReference, fmi3Float64)
FMI3_REFUSED_MODE(fmi3EnterContinuousTimeMode)
FMI3_REFUSED_MODE(fmi3EvaluateDiscreteStates)
FMI3_REFUSED_MODE(fmi3EnterEventMode)
FMI3_REFUSED_MODE(fmi3EnterStepMode)
FMI3_REFUSED_MODE(fmi3EnterConfigurationMode)
FMI3_REFUSED_MODE(fmi3ExitConfigurationMode)

}  // extern "C"
