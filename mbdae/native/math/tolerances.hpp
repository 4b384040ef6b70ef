// Thresholds of evaluations and steps. All are defined and documented in Python, under the same names, and passed by
// mbdae/mechanism/formulations/core_description.py; those of step-size control are set for each run. The core has
// no literal thresholds.
#pragma once

#include <vector>

#include "math/fields.hpp"

namespace mbdae {

struct Tolerances {
  // tolerances.py
  double eps, tiny, below_rounding, rounding, sum_rounding, evaluation_rounding, solution_rounding, search_tolerance;
  double same_state, zero_speed, pivot_rank, truncation, visible;
  // mechanism/tree/manifold.py
  double max_rotation;         // rad, largest joint rotation within one step
  std::vector<double> series;  // B_2k/(2k)!, k = 1, 2, ...
  // closures/independent_rows.py: pivot ratios, and numbers of rows and iterations
  double smallest_pivot, worst_conditioning, growth_tolerance, reselection_ratio, probe_tolerance;
  double cg_tolerance;  // relative to the initial squared residual of conjugate gradients
  int many_rows, extra_cg_iterations;
  // formulations/steps/projection.py
  double projection_max_remaining, projection_open, projection_stalled;
  int projection_iterations;
  // formulations/ggl.py, closure_friction.py, friction_interface.py
  int ggl_iterations, friction_iterations;
  // cosine of the largest rotation of a slip direction in a step; clear slip speed, as a multiple of the smallest one
  double slip_cosine, clear_slip;
  int stage_iterations;                                         // Newton iterations of stages, for tangents and adjoints
  std::vector<double> row_scales, q_scales, coordinate_scales;  // scales of g (ng,), q (nq,) and v (nv,)

  FIELDS(eps, tiny, below_rounding, rounding, sum_rounding, evaluation_rounding, solution_rounding, search_tolerance,
         same_state, zero_speed, pivot_rank, truncation, visible, max_rotation, series, smallest_pivot,
         worst_conditioning, growth_tolerance, reselection_ratio, probe_tolerance, cg_tolerance, many_rows,
         extra_cg_iterations, projection_max_remaining, projection_open, projection_stalled, projection_iterations,
         ggl_iterations, friction_iterations, slip_cosine, clear_slip, stage_iterations, row_scales, q_scales, coordinate_scales)
};

}  // namespace mbdae
