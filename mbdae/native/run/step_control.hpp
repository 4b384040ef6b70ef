// Step sizes: under error control, or on a grid (mbdae/integrate/steppers, mbdae/methods/controller.py).
#pragma once

#include "math/factorizations.hpp"
#include "math/fields.hpp"

namespace mbdae {

// State of a smooth interval: current time, and its end.
struct SmoothInterval {
  double t = 0, sign = 1;    // s; 1 forwards, -1 backwards
  double stop = 0, end = 0;  // s: end of the interval as evaluated by forces, and its nominal time
  double t1 = 0;             // s: end of the span

  FIELDS(t, sign, stop, end, t1)
};

// A step: its size, positive, and its end time.
struct Proposal {
  double h, t_next;
};

// Memory of step-size control, which changes from step to step.
struct StepMemory {
  double h = 0;           // s: the next step
  double uncut_size = 0;  // s: the step size before truncation at the end of an interval
  double last = 0;        // error norm of the last step
  bool rejected = false;  // was the last step?
};

struct StepControl : StepMemory {
  double largest = 0;  // s
  double rtol = 0;
  Vector atol;                             // (1,) or (measured,)
  double tiny = 0;                         // keeps scales positive if both tolerances are zero
  double companion = 0, blend = 1;         // weight of the second of two error estimates, and how they are blended
  double power = 1;                        // of h in the error estimate
  double exponent = 0, last_exponent = 0;  // of an accepted error, and of the previous one
  double safety = 0, smallest_factor = 0, largest_factor = 0;
  double min_growth = 1;                         // growth up to this factor is ignored
  double smallest_error = 0, smallest_last = 0;  // smaller errors count as these
  double agreement = 0;                          // of the remaining time: a step this close to it takes all of it
  double spacings = 0;                           // of the times of a run: a smaller step is rejected

  FIELDS(h, uncut_size, last, rejected, largest, rtol, atol, tiny, companion, blend, power, exponent, last_exponent, safety,
         smallest_factor, largest_factor, min_growth, smallest_error, smallest_last, agreement, spacings)

  bool large_enough(const SmoothInterval& interval, double size) const;  // well above the rounding of times
  bool propose(const SmoothInterval& interval, Proposal& p);             // false if Python must handle the failure
  // Norm of error estimates (errors, ny), of which the first n components are measured. Rounding of v at a stage, eps
  // |v| / (h ahat_ii), cannot be controlled: `noise` adds to the scale of components from..to, those of v.
  double error_norm(const double* e, int errors, int ny, int n, const double* size0, const double* size1, int from,
                    int to, double noise) const;
  double next_step(double taken, double error);  // size, after one with an error norm
};

struct GridMemory {
  long i = 0;           // the last point of the grid
  bool on_grid = true;  // is the run there?
};

struct Grid : GridMemory {
  double step = 0, t0 = 0;  // s
  long n = 0;               // steps of the whole span
  double coincident = 0;    // of a step: tolerance for a time to count as on the grid

  FIELDS(i, on_grid, step, t0, n, coincident)

  Proposal propose(const SmoothInterval& interval);
  void undo_step();  // of a truncated step: the next one leads to its grid point
  bool more_before_end(
      const SmoothInterval& interval) const;  // is there a grid point of this interval after the next one?
  double at(const SmoothInterval& interval, long k) const;  // s: time of point k
};

}  // namespace mbdae
