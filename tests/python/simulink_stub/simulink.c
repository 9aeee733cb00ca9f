// What stands at the end of an S-function: here, C functions that run its block as Simulink would.
#if !defined(S_FUNCTION_LEVEL) || S_FUNCTION_LEVEL != 2
#error "S_FUNCTION_LEVEL is to be 2"
#endif
#if !defined(MDL_START) || !defined(MDL_UPDATE) || !defined(MDL_INITIALIZE_CONDITIONS)
#error "the methods are not announced"
#endif

// Simulink's file makes a global function of the S-function's name: nothing else may be called so.
extern "C" void S_FUNCTION_NAME(SimStruct*) {}

#pragma GCC visibility push(default)  // mex exports what Simulink calls, and nothing else
extern "C" {

SimStruct* block_new(double began) {
  auto* S = new SimStruct;
  mdlInitializeSizes(S);
  S->phase = SimStruct::times;
  mdlInitializeSampleTimes(S);
  for (auto* ports : {&S->in, &S->out}) {
    for (StubPort& port : *ports) port.values.resize(static_cast<unsigned>(port.width));
  }
  S->phase = SimStruct::running;
  S->began = S->now = began;
  mdlStart(S);
  mdlInitializeConditions(S);
  return S;
}

void block_restart(SimStruct* S, double now) {
  S->now = now;
  mdlInitializeConditions(S);
}

int block_inputs(SimStruct* S) { return static_cast<int>(S->in.size()); }

/// Outputs of all ports, one behind the other; `major` steps move the memory. Returns how many.
int block_step(SimStruct* S, double now, const double* inputs, double* outputs, int major) {
  S->now = now;
  for (StubPort& port : S->in) port.values[0] = *inputs++;
  mdlOutputs(S, 0);
  if (major) mdlUpdate(S, 0);
  int count = 0;
  for (const StubPort& port : S->out) {
    for (const double value : port.values) outputs[count++] = value;
  }
  return S->error != nullptr ? -1 : count;
}

void block_free(SimStruct* S) {
  mdlTerminate(S);
  stub_require(S->pointers[0] == nullptr, "the pointer outlives the block");
  delete S;
}

}  // extern "C"
#pragma GCC visibility pop
