// A motor that another program might have made: a sampled position controller with a lag, in its own units.
//   T x' = kp (reference - angle) - kd speed - x,   torque = gain x + feed speed
// Inputs: angle (0), speed (1); output: torque (2); parameters: kp (3), kd (4), T (5), gain (6), feed (7),
// reference (8), steps (9, an integer), fail (10): the time from which steps fail. The lag is solved exactly.
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ANGLE, SPEED, TORQUE, KP, KD, LAG, GAIN, FEED, REFERENCE, STEPS, FAIL, NUMBERS };

typedef struct {
  double value[NUMBERS];
  double state;
  int started;
} Motor;

int living = 0;  // instances that have not been freed

static Motor* motor_new(void) {
  Motor* m = calloc(1, sizeof(Motor));
  m->value[KP] = 1.0, m->value[GAIN] = 1.0, m->value[FAIL] = 1e9;
  ++living;
  return m;
}

static void motor_free(Motor* m) {
  --living;
  free(m);
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
