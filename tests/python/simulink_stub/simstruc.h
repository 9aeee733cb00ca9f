// A stub of the part of Simulink's header that exported S-functions use. It is not Simulink's: names
// and meanings are those of the documentation, and each call is checked against what that allows.
#ifndef SIMSTRUC_STUB
#define SIMSTRUC_STUB

#include <cstdio>
#include <cstdlib>
#include <vector>

typedef double real_T;
typedef double time_T;
typedef int int_T;

#define INHERITED_SAMPLE_TIME (-1.0)
#define SS_OPTION_EXCEPTION_FREE_CODE 1
#define min(a, b) ((a) < (b) ? (a) : (b))  // as Simulink's headers do
#define max(a, b) ((a) > (b) ? (a) : (b))

struct StubPort {
  int_T width = 0;
  bool contiguous = false, direct = false;
  std::vector<real_T> values;
};

struct SimStruct {
  enum { sizes, times, running } phase = sizes;
  std::vector<StubPort> in, out;
  std::vector<void*> pointers;
  int_T parameters = -1, samples = 0;
  real_T sample = 0, offset = -1;
  time_T now = 0, began = 0;
  const char* error = nullptr;
};

inline void stub_require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "simstruc stub: %s\n", what);
  std::abort();
}
inline void stub_in_sizes(const SimStruct* S) {
  stub_require(S->phase == SimStruct::sizes, "belongs in mdlInitializeSizes");
}

inline void ssSetNumSFcnParams(SimStruct* S, int_T n) { stub_in_sizes(S), S->parameters = n; }
inline int_T ssGetNumSFcnParams(SimStruct* S) { return S->parameters; }
inline int_T ssGetSFcnParamsCount(SimStruct*) { return 0; }
inline void ssSetNumContStates(SimStruct* S, int_T) { stub_in_sizes(S); }
inline void ssSetNumDiscStates(SimStruct* S, int_T) { stub_in_sizes(S); }
inline int_T ssSetNumInputPorts(SimStruct* S, int_T n) {
  stub_in_sizes(S), S->in.resize(static_cast<unsigned>(n));
  return 1;
}
inline int_T ssSetNumOutputPorts(SimStruct* S, int_T n) {
  stub_in_sizes(S), S->out.resize(static_cast<unsigned>(n));
  return 1;
}
inline StubPort& stub_port(std::vector<StubPort>& ports, int_T k) {
  stub_require(k >= 0 && static_cast<unsigned>(k) < ports.size(), "no such port");
  return ports[static_cast<unsigned>(k)];
}
inline int_T ssSetInputPortWidth(SimStruct* S, int_T k, int_T width) {
  stub_in_sizes(S), stub_require(width > 0, "width of a port"), stub_port(S->in, k).width = width;
  return 1;
}
inline int_T ssSetOutputPortWidth(SimStruct* S, int_T k, int_T width) {
  stub_in_sizes(S), stub_require(width > 0, "width of a port"), stub_port(S->out, k).width = width;
  return 1;
}
inline void ssSetInputPortRequiredContiguous(SimStruct* S, int_T k, int_T yes) {
  stub_in_sizes(S), stub_port(S->in, k).contiguous = yes != 0;
}
inline void ssSetInputPortDirectFeedThrough(SimStruct* S, int_T k, int_T yes) {
  stub_in_sizes(S), stub_port(S->in, k).direct = yes != 0;
}
inline void ssSetNumSampleTimes(SimStruct* S, int_T n) { stub_in_sizes(S), S->samples = n; }
inline void ssSetNumPWork(SimStruct* S, int_T n) {
  stub_in_sizes(S), S->pointers.resize(static_cast<unsigned>(n), nullptr);
}
inline void ssSetOptions(SimStruct* S, unsigned) { stub_in_sizes(S); }

inline void ssSetSampleTime(SimStruct* S, int_T k, time_T value) {
  stub_require(S->phase == SimStruct::times && k < S->samples, "sample time"), S->sample = value;
}
inline void ssSetOffsetTime(SimStruct* S, int_T k, time_T value) {
  stub_require(S->phase == SimStruct::times && k < S->samples, "offset time"), S->offset = value;
}

inline void stub_in_run(const SimStruct* S) {
  stub_require(S->phase == SimStruct::running, "belongs in a run");
}
inline void* ssGetPWorkValue(SimStruct* S, int_T k) {
  stub_in_run(S);
  return S->pointers.at(static_cast<unsigned>(k));
}
inline void ssSetPWorkValue(SimStruct* S, int_T k, void* value) {
  stub_in_run(S), S->pointers.at(static_cast<unsigned>(k)) = value;
}
inline time_T ssGetT(SimStruct* S) { return stub_in_run(S), S->now; }
inline time_T ssGetTStart(SimStruct* S) { return stub_in_run(S), S->began; }
inline void ssSetErrorStatus(SimStruct* S, const char* text) { S->error = text; }
inline const real_T* ssGetInputPortRealSignal(SimStruct* S, int_T k) {
  const StubPort& port = stub_port(S->in, k);
  stub_in_run(S), stub_require(port.contiguous, "the input is not contiguous");
  stub_require(port.direct, "an input that is read is direct feedthrough");
  return port.values.data();
}
inline real_T* ssGetOutputPortRealSignal(SimStruct* S, int_T k) {
  stub_in_run(S);
  return stub_port(S->out, k).values.data();
}

#endif
