// Thresholds of evaluations and steps. All are defined and documented in Python and passed by
// mbdae/mechanism/formulations/core_description.py; those of step-size control are set for each run. None is a literal
// here.
#pragma once

#include <vector>

namespace mbdae {

struct Tolerances {
  // mechanism/manifold.py
  double largest_turn;         // rad, largest joint rotation within one step
  std::vector<double> series;  // B_2k/(2k)!, k = 1, 2, ...
  double series_end;           // relative size of the terms that end a series
  // formulations/index2.py
  double same_point;      // of 1 + |q|: configurations closer than this are the same
  double smallest_pivot;  // relative to the largest: below, a system is singular
  // closures/independent_rows.py
  double independent;                // relative pivot size above which rows are independent
  double worst_conditioning, grown;  // pivot ratios: of rows in use, and of others
  int many;                          // number of rows above which all rows are examined only for a reason
  double reason, probed;
  double converged;  // squared residual at which conjugate gradients end
  double eps;        // of the largest pivot of G M^-1 G^T: smaller ones are rounding
  int spare;         // iterations beyond those of exact arithmetic
  // formulations/projection.py
  double truncation, rounding, falling, open, stalled;
  double kept;  // |G v + g_t| over all rows, of its largest terms
  int iterations;
  double unmoved;                                          // rad or m
  std::vector<double> row_scales, q_scales, coordinate_scales;  // units of g (ng,), q (nq,) and v (nv,)
  // formulations/ggl.py
  int meeting;             // iterations
  double met, halted, gaping;  // of 1 + |q| twice, rad or characteristic lengths
  // formulations/closure_friction.py
  double still, turned;             // a speed, a cosine
  int loading;                      // iterations
  double loaded, settled, nothing;  // of the largest T, twice
  // sensitivity/coupled_stages.cpp
  int restages;     // iterations of stages that are computed again
  double restaged;  // of 1 + |x|: the last change of stages that are computed again, whose square is left
};

}  // namespace mbdae
