// A motor that another program might have made, as an FMU of FMI 2.0 or 3.0 (FMI = 2, 3): a sampled position
// controller with a lag, in its own units.
//   T x' = kp (reference - angle) - kd speed - x,   torque = gain x + feed speed
// Inputs: angle (0), speed (1); output: torque (2); parameters: kp (3), kd (4), T (5), gain (6), feed (7),
// reference (8), steps (9, an integer), fail (10): the time from which steps fail. The lag is solved exactly.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#if FMI == 2
#include "fmi2Functions.h"
#define NAME(name) fmi2##name
#define STATE(verb, end) fmi2##verb##FMUstate##end
#define COUNT  // FMI 3.0 gives the number of values, too
typedef fmi2Component Instance;
typedef fmi2FMUstate State;
typedef fmi2Real Real;
typedef fmi2Integer Integer;
#else
#include "fmi3Functions.h"
#define NAME(name) fmi3##name
#define STATE(verb, end) fmi3##verb##FMUState##end
#define COUNT , size_t m
typedef fmi3Instance Instance;
typedef fmi3FMUState State;
typedef fmi3Float64 Real;
typedef fmi3Int32 Integer;
#endif
typedef NAME(Status) Status;
typedef NAME(Boolean) Boolean;
typedef NAME(ValueReference) Reference;
enum { OK = NAME(OK), FAILED = NAME(Error) };
enum { ANGLE, SPEED, TORQUE, KP, KD, LAG, GAIN, FEED, REFERENCE, STEPS, FAIL, NUMBERS };

typedef struct {
  double value[NUMBERS];
  double state;
} Motor;

int living = 0;  // instances that have not been freed

static Motor* motor_new(void) {
  Motor* m = calloc(1, sizeof(Motor));
  m->value[KP] = 1.0, m->value[GAIN] = 1.0, m->value[FAIL] = 1e9;
  ++living;
  return m;
}

static double demand(const Motor* m) {
  return m->value[KP] * (m->value[REFERENCE] - m->value[ANGLE]) - m->value[KD] * m->value[SPEED];
}

static int motor_step(Motor* m, double t, double h) {
  if (t + h > m->value[FAIL]) return 0;
  const double keep = m->value[LAG] > 0 ? exp(-h / m->value[LAG]) : 0.0;
  m->state = keep * m->state + (1 - keep) * demand(m);
  m->value[STEPS] += 1;
  return 1;
}

static double motor_get(Motor* m, unsigned i) {
  const double x = m->value[LAG] > 0 ? m->state : demand(m);
  m->value[TORQUE] = m->value[GAIN] * x + m->value[FEED] * m->value[SPEED];
  return m->value[i];
}

#if FMI == 2
static fmi2CallbackLogger say;
static fmi2ComponentEnvironment whom;

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* functions, fmi2Boolean visible, fmi2Boolean logging) {
  if (type != fmi2CoSimulation || strcmp(guid, "motor2")) return NULL;
  say = functions->logger, whom = functions->componentEnvironment;
  return motor_new();
}
Status fmi2SetupExperiment(Instance c, Boolean a, Real tol, Real t0, Boolean b, Real t1) { return OK; }
Status fmi2EnterInitializationMode(Instance c) { return OK; }
Status fmi2DoStep(Instance c, Real t, Real h, Boolean no_set) {
  if (motor_step(c, t, h)) return OK;
  say(whom, "motor", FAILED, "error", "the winding is too hot");
  return FAILED;
}
#define fmi2GetFloat64 fmi2GetReal
#define fmi2SetFloat64 fmi2SetReal
#define fmi2SetInt32 fmi2SetInteger
#define fmi2DeserializeFMUstate fmi2DeSerializeFMUstate
#else
static fmi3LogMessageCallback say;
static fmi3InstanceEnvironment whom;

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
  if (strcmp(token, "motor3") || events || early) return NULL;
  say = log, whom = environment;
  return motor_new();
}
Status fmi3EnterInitializationMode(Instance c, Boolean a, Real tol, Real t0, Boolean b, Real t1) { return OK; }
Status fmi3DoStep(Instance c, Real t, Real h, Boolean no_set, Boolean* event, Boolean* ends, Boolean* early,
                  Real* last) {
  *event = *ends = *early = 0, *last = t + h;
  if (motor_step(c, t, h)) return OK;
  say(whom, FAILED, "error", "the winding is too hot");
  return FAILED;
}
#endif

const char* NAME(GetVersion)(void) { return FMI == 2 ? "2.0" : "3.0"; }
void NAME(FreeInstance)(Instance c) {
  --living;
  free(c);
}
Status NAME(ExitInitializationMode)(Instance c) { return OK; }
Status NAME(Terminate)(Instance c) { return OK; }

Status NAME(GetFloat64)(Instance c, const Reference r[], size_t n, Real x[] COUNT) {
  for (size_t i = 0; i < n; ++i) x[i] = motor_get(c, r[i]);
  return OK;
}
Status NAME(SetFloat64)(Instance c, const Reference r[], size_t n, const Real x[] COUNT) {
  for (size_t i = 0; i < n; ++i) ((Motor*)c)->value[r[i]] = x[i];
  return OK;
}
Status NAME(SetInt32)(Instance c, const Reference r[], size_t n, const Integer x[] COUNT) {
  if (FMI == 3 && *r != 9) return FAILED;  // items of enumerations have 64 bits
  for (size_t i = 0; i < n; ++i) ((Motor*)c)->value[r[i]] = x[i];
  return OK;
}
#if FMI == 3
Status fmi3SetInt64(Instance c, const Reference r[], size_t n, const fmi3Int64 x[], size_t m) {
  for (size_t i = 0; i < n; ++i) ((Motor*)c)->value[r[i]] = x[i];
  return OK;
}
#endif

Status STATE(Get, )(Instance c, State* s) {
  if (!*s) *s = malloc(sizeof(Motor));
  memcpy(*s, c, sizeof(Motor));
  return OK;
}
Status STATE(Set, )(Instance c, State s) { return memcpy(c, s, sizeof(Motor)), OK; }
Status STATE(Free, )(Instance c, State* s) { return free(*s), *s = NULL, OK; }
Status STATE(Serialized, Size)(Instance c, State s, size_t* n) { return *n = sizeof(Motor), OK; }
Status STATE(Serialize, )(Instance c, State s, NAME(Byte) x[], size_t n) { return memcpy(x, s, n), OK; }
Status STATE(Deserialize, )(Instance c, const NAME(Byte) x[], size_t n, State* s) {
  return *s = malloc(n), memcpy(*s, x, n), OK;
}
