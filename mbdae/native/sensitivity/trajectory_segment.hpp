// Recomputed steps of a segment of a run: carries, tangents and adjoints (mbdae/integrate/trajectory/trajectory.py).
#pragma once

#include "sensitivity/projection_sensitivity.hpp"
#include "run/step_control.hpp"
#include "steps/collocation.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

// Steps between nodes t (m + 1,), y (m + 1, length): one between neighbouring nodes, or two of half the size.
struct TrajectorySegment {
  const Tableau* tableau;  // or
  const Radau* radau;
  bool halved, project;
  size_t steps;
  const double *t, *y;
};

// Tolerances of a run: of projections that keep the carry, and of the agreement of recomputed steps.
struct RepeatTolerances {
  bool adaptive;
  StepControl control;
  double tolerated_move, tiny;   // with fixed steps, relative to magnitudes
  double same_state, agreement;  // relative to 1 + |y|
};

// The carry at each node, (m + 1, nc), from that at the first one, and the nodes at which it was restarted. Recomputed
// states continue independently of the run, unless they deviate by more than `agreement`.
struct Recomputed {
  Vector carries, end;
  std::vector<int> restarted;  // (m + 1,)
  size_t steps;                // number of steps whose ends agree within `same_state`
};

void recompute(Index2System& s, const TrajectorySegment& segment, const RepeatTolerances& tolerances, Recomputed& out);
// Replace cotangents (costs, ny + nc) at the last node by those at the first one; add `extra` (m + 1, costs, ny + nc)
// at the inner nodes, and accumulate the cotangents of parameters (costs, k).
void adjoint(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& segment, const double* carries,
             int costs, const double* extra, double* cotangents, double* p);
size_t carry_size(const Index2System& s, const TrajectorySegment& segment);
// Tangents at all nodes, (m + 1, d, ny + nc), from those at the first node (d, ny + nc); dh (d,): tangents of the size
// of each step, or null.
void tangent(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& segment, const double* carries,
             int d, const double* dp, const double* dh, const double* first, double* tangents);

}  // namespace mbdae
