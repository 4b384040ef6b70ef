// The motor of motor.h as an FMU of FMI 2.0.
#include "fmi2Functions.h"
#include "motor.h"

static fmi2CallbackLogger say;
static fmi2ComponentEnvironment whom;

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return "2.0"; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* functions, fmi2Boolean visible, fmi2Boolean logging) {
  if (type != fmi2CoSimulation || strcmp(guid, "motor2")) return NULL;
  say = functions->logger, whom = functions->componentEnvironment;
  return motor_new();
}

void fmi2FreeInstance(fmi2Component c) { motor_free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real tol, fmi2Real t0, fmi2Boolean b, fmi2Real t1) {
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return ((Motor*)c)->started = 1, fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real x[]) {
  for (size_t i = 0; i < n; ++i) x[i] = motor_get(c, r[i]);
  return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real x[]) {
  for (size_t i = 0; i < n; ++i) ((Motor*)c)->value[r[i]] = x[i];
  return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer x[]) {
  for (size_t i = 0; i < n; ++i) ((Motor*)c)->value[r[i]] = x[i];
  return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_set) {
  if (motor_step(c, t, h)) return fmi2OK;
  say(whom, "motor", fmi2Error, "error", "the winding is too hot");
  return fmi2Error;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* s) {
  if (!*s) *s = malloc(sizeof(Motor));
  memcpy(*s, c, sizeof(Motor));
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { return memcpy(c, s, sizeof(Motor)), fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* s) { return free(*s), *s = NULL, fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t* n) { return *n = sizeof(Motor), fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte x[], size_t n) {
  return memcpy(x, s, n), fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte x[], size_t n, fmi2FMUstate* s) {
  return *s = malloc(n), memcpy(*s, x, n), fmi2OK;
}
