// Many steps of a run once more: what is carried along them, their tangents and adjoints (mbdae/integrate/trajectory.py).
#pragma once

#include "sensitivity/projection_sensitivity.hpp"
#include "run/step_control.hpp"
#include "sensitivity/step_sensitivity.hpp"

namespace mbdae {

// Steps between nodes t (m + 1,), y (m + 1, length): one from each to the next, or two of half the size.
struct TrajectorySegment {
  const Tableau& tableau;
  bool halved, project;
  size_t steps;
  const double *t, *y;
};

// What a run says of moves that its steps tolerate, and how its steps are told from others.
struct RepeatTolerances {
  bool adaptive;
  StepControl control;
  double tolerated;              // with fixed steps, of 1 + |y|
  double repeated, synchronous;  // of 1 + |y|
};

// What is carried to each node, (m + 1, nc), from what is at the first, and where it was found anew. Points go on beside
// it, but where they are further than `synchronous` from the run's.
struct Recomputed {
  Numbers carries, end;
  std::vector<int> renewed;  // (m + 1,)
  size_t steps;              // that ended within `repeated`
};

void walk(Index2System& s, const TrajectorySegment& segment, const RepeatTolerances& like, Recomputed& out);
// Cotangents (ny + nc,) behind the last node become those behind the first; `extra` (m + 1, ny + nc) come in at the
// nodes but the first and the last, and those of parameters (k,) are added up.
void adjoint(Index2System& s, Parameters& parameters, const TrajectorySegment& segment, const double* carries,
             const double* extra, double* bar, double* p);
// Variations (d, ny + nc) at the first node lead to those at all of them, (m + 1, d, ny + nc).
void tangent(Index2System& s, Parameters& parameters, const TrajectorySegment& segment, const double* carries, int d,
             const double* dp, const double* first, double* along);

}  // namespace mbdae
