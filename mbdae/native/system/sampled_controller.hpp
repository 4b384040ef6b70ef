// Sampled controllers: they measure at sampling instants, and hold their torques in between
// (mbdae/mechanism/forces/sampled.py, joint_pid.py).
#pragma once

#include <functional>

#include "math/factorizations.hpp"
#include "mechanism/time_functions.hpp"

namespace mbdae {

struct HeldInput {
  int input = -1;                           // index of the input that the controller sets
  int value = -1, rate = -1, instant = -1;  // indices in s of value + rate (t - instant), or of the value

  FIELDS(input, value, rate, instant)
};

struct SampledController {
  NAMED_ENUM(enum, Kind, pid, python)
  Kind kind = pid;
  double rate = 1, offset = 0;  // Hz; a sampling instant in s
  double coincide = 0;          // relative to a period: a time this close to an instant is the instant
  int state = 0, states = 0;    // first index in s, and number, of its states: torques and memory
  TimeFunction reference;             // reference of a PID controller; a: kp, ki, kd
  Vector a;
  int x = 0, v = 0;  // indices in y of the controlled coordinate and of its velocity
  // Python: (t, q, v, s of all laws) -> states of the controller after t.
  std::function<void(double t, const double* q, const double* v, const double* s, double* after)> call;

  std::vector<HeldInput> inputs;

  FIELDS(kind, rate, offset, coincide, state, states, reference, a, x, v, inputs)

  double next(double t) const;                   // first sampling instant after t
  bool has_jumped(double t, double late) const;  // whether the nearest instant is more than `late` roundings before t
  // Set its states after t from y = (q, v, s, ...) before t, if t is a sampling instant.
  void sample(double t, const double* y, int nq, int nv, double* after) const;
};

}  // namespace mbdae
