// Step sizes: by error control, or on a grid (mbdae/integrate/steppers, mbdae/methods/controller.py).
#pragma once

#include "math/factorizations.hpp"
#include "math/fields.hpp"

namespace mbdae {

// State of a smooth interval: current time, and its end.
struct SmoothInterval {
  double t = 0, sign = 1;    // s; 1 forward, -1 backward
  double stop = 0, end = 0;  // s: end of the interval as evaluated by forces, and its nominal time
  double t1 = 0;             // s: end of the span

  FIELDS(t, sign, stop, end, t1)
};

// A step: its positive size, and the time of its end.
struct Proposal {
  double h, t_next;
};

// The state of step-size control, which changes from step to step.
struct StepMemory {
  double h = 0;           // s: size of the next step
  double uncut_size = 0;  // s: the step size before truncation at the end of an interval
  double last = 0;        // error norm of the last step
  bool rejected = false;  // the last step was rejected
};

struct StepControl : StepMemory {
  double largest = 0;  // s
  double rtol = 0;
  Vector atol;                             // (1,) or (components under error control,)
  double tiny = 0;                         // keeps scales positive if both tolerances are zero
  double companion = 0, blend = 1;         // weight of the second of two error estimates, exponent of their mean
  double power = 1;                        // power of h in the error estimate
  double exponent = 0, last_exponent = 0;  // exponents of an accepted error, and of the previous error
  double safety = 0, smallest_factor = 0, largest_factor = 0;
  double min_growth = 1;                         // growth up to this factor is ignored
  double smallest_error = 0, smallest_last = 0;  // lower bounds of errors
  // relative to the remaining time: a step this close to it is extended to it
  double agreement = 0;
  double spacings = 0;  // spacings of t: smallest step

  FIELDS(h, uncut_size, last, rejected, largest, rtol, atol, tiny, companion, blend, power, exponent, last_exponent, safety,
         smallest_factor, largest_factor, min_growth, smallest_error, smallest_last, agreement, spacings)

  bool large_enough(const SmoothInterval& interval, double size) const;  // well above the rounding of times
  bool propose(const SmoothInterval& interval, Proposal& p);             // false: Python must handle the failure
  // Norm of error estimates (errors, ny), over their first n components. Step-size control cannot reduce the rounding
  // error of v at a stage, eps |v| / (h ahat_ii): `noise` adds to the scales of components from..to, which are those of
  // v.
  double error_norm(const double* e, int errors, int ny, int n, const double* size0, const double* size1, int from,
                    int to, double noise) const;
  double next_step(double taken, double error);  // next size, after a step with this error norm
};

struct GridMemory {
  long i = 0;           // index of the last grid point
  bool on_grid = true;  // the run is at this point
};

struct Grid : GridMemory {
  double step = 0, t0 = 0;  // s
  long n = 0;               // number of steps of the span
  double coincident = 0;    // relative to a step: a time this close to a grid point is on the grid

  FIELDS(i, on_grid, step, t0, n, coincident)

  Proposal propose(const SmoothInterval& interval);
  void undo_step();  // after a truncated step: the next step ends at its grid point
  // whether the interval has a grid point after the next one
  bool more_before_end(const SmoothInterval& interval) const;
  double at(const SmoothInterval& interval, long k) const;  // s: time of point k
};

}  // namespace mbdae
