// Thresholds of points and steps. Python has them all and says what they are for
// (mbdae/mechanism/formulations/core_description.py hands them over); those of step-size control come with a run. None is
// a literal here.
#pragma once

#include <vector>

namespace mbdae {

struct Tolerances {
  // mechanism/manifold.py
  double largest_turn;         // rad, within one step
  std::vector<double> series;  // B_2k/(2k)!, k = 1, 2, ...
  double series_end;           // of a sum: smaller terms end it
  // formulations/index2.py
  double same_point;      // of 1 + |q|: points so near are one
  double smallest_pivot;  // of the largest: below, a system is singular
  // closures/independent_rows.py
  double independent;                // of pivots: above, rows are
  double worst_conditioning, grown;  // of pivots, as the rows in use have them and others
  int many;                          // rows: beyond, all of them are looked at where there is reason to
  double reason, probed;
  double converged;  // of a squared residual: where conjugate gradients end
  int spare;         // of their iterations, beyond those that exact numbers need
  // formulations/projection.py
  double truncation, rounding, falling, open, stalled;
  int iterations;
  double unmoved;                                          // rad or m
  std::vector<double> row_scales, q_scales, coordinate_scales;  // what 1 of g (ng,), q (nq,) and v (nv,) is in its unit
  // formulations/ggl.py
  int meeting;             // iterations
  double met, halted, gaping;  // of 1 + |q|, of 1 + |q|, m or rad
  // formulations/closure_friction.py
  double still, turned;             // m/s, a cosine
  int loading;                      // iterations
  double loaded, settled, nothing;  // of the largest T, twice
};

}  // namespace mbdae
