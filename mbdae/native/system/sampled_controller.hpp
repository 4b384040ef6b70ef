// Controllers that sample a mechanism at instants and hold their torques in between (mbdae/mechanism/forces/sampled.py,
// joint_pid.py).
#pragma once

#include <functional>

#include "math/factorizations.hpp"
#include "mechanism/time_functions.hpp"

namespace mbdae {

struct HeldInput {
  int input = -1;                           // number of an input that follows the controller
  int value = -1, rate = -1, instant = -1;  // indices in s: value + rate (t - instant), or value alone

  FIELDS(input, value, rate, instant)
};

struct SampledController {
  NAMED_ENUM(enum, Kind, pid, python)
  Kind kind = pid;
  double rate = 1, offset = 0;  // Hz; a sampling instant in s
  double coincide = 0;          // of a period: tolerance for a time to count as an instant
  int state = 0, states = 0;    // first index of its states, torques and memory, in s
  TimeFunction reference;             // of a PID controller; a: kp, ki, kd
  Vector a;
  int x = 0, v = 0;  // first index in y of the controlled coordinate, and of the velocity
  // Python: (t, q, v, s of all laws) -> its states after the instant.
  std::function<void(double t, const double* q, const double* v, const double* s, double* after)> call;

  std::vector<HeldInput> inputs;

  FIELDS(kind, rate, offset, coincide, state, states, reference, a, x, v, inputs)

  double next(double t) const;  // the first instant after t
  bool has_jumped(double t, double late) const;  // more than `late` roundings of t before t, at the nearest instant
  // s (states,) after time t from y = (q, v, s, ...) before it, if that is an instant.
  void sample(double t, const double* y, int nq, int nv, double* after) const;
};

}  // namespace mbdae
