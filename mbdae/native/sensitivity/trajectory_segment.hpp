// Recompute many steps of a run: carries, tangents and adjoints (mbdae/integrate/trajectory/trajectory.py).
#pragma once

#include "sensitivity/projection_sensitivity.hpp"
#include "run/step_control.hpp"
#include "steps/collocation.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

// Steps between nodes t (m + 1,), y (m + 1, length): one from each to the next, or two of half the size.
struct TrajectorySegment {
  const Tableau* tableau;  // or
  const Radau* radau;
  bool halved, project;
  size_t steps;
  const double *t, *y;
};

// Tolerances of a run: projections without a new carry, and agreement of recomputed steps.
struct RepeatTolerances {
  bool adaptive;
  StepControl control;
  double tolerated_move, tiny;   // with fixed steps, of magnitudes
  double same_state, agreement;  // of 1 + |y|
};

// The carry at each node, (m + 1, nc), from that of the first, and where it was recomputed. Recomputed points continue
// independently of the run, unless they differ by more than `agreement`.
struct Recomputed {
  Vector carries, end;
  std::vector<int> restarted;  // (m + 1,)
  size_t steps;                // that ended within `same_state`
};

void recompute(Index2System& s, const TrajectorySegment& segment, const RepeatTolerances& tolerances, Recomputed& out);
// Cotangents (costs, ny + nc) at the last node become those at the first; `extra` (m + 1, costs, ny + nc) are added at
// the inner nodes, and those of parameters (costs, k) are accumulated.
void adjoint(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& segment, const double* carries,
             int costs, const double* extra, double* bars, double* p);
size_t carry_size(const Index2System& s, const TrajectorySegment& segment);
// Tangents (d, ny + nc) at the first node lead to those at all of them, (m + 1, d, ny + nc); dh (d,) are those of the
// size of each step, or missing.
void tangent(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& segment, const double* carries,
             int d, const double* dp, const double* dh, const double* first, double* along);

}  // namespace mbdae
