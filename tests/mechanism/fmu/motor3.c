// The motor of motor.h as an FMU of FMI 3.0.
#include "fmi3Functions.h"
#include "motor.h"

static fmi3LogMessageCallback say;
static fmi3InstanceEnvironment whom;

const char* fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
  if (strcmp(token, "motor3") || events || early) return NULL;
  say = log, whom = environment;
  return motor_new();
}

void fmi3FreeInstance(fmi3Instance c) { motor_free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 tol, fmi3Float64 t0, fmi3Boolean b,
                                       fmi3Float64 t1) {
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return ((Motor*)c)->started = 1, fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 x[], size_t m) {
  for (size_t i = 0; i < n; ++i) x[i] = motor_get(c, r[i]);
  return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 x[], size_t m) {
  for (size_t i = 0; i < n; ++i) ((Motor*)c)->value[r[i]] = x[i];
  return fmi3OK;
}
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int32 x[], size_t m) {
  for (size_t i = 0; i < n; ++i) ((Motor*)c)->value[r[i]] = x[i];
  return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_set, fmi3Boolean* event,
                      fmi3Boolean* ends, fmi3Boolean* early, fmi3Float64* last) {
  *event = *ends = *early = 0, *last = t + h;
  if (motor_step(c, t, h)) return fmi3OK;
  say(whom, fmi3Error, "error", "the winding is too hot");
  return fmi3Error;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState* s) {
  if (!*s) *s = malloc(sizeof(Motor));
  memcpy(*s, c, sizeof(Motor));
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState s) { return memcpy(c, s, sizeof(Motor)), fmi3OK; }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState* s) { return free(*s), *s = NULL, fmi3OK; }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState s, size_t* n) { return *n = sizeof(Motor), fmi3OK; }
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState s, fmi3Byte x[], size_t n) {
  return memcpy(x, s, n), fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte x[], size_t n, fmi3FMUState* s) {
  return *s = malloc(n), memcpy(*s, x, n), fmi3OK;
}
