// Runs in the core that request nothing from Python: start, first step, steps to the end
// (mbdae/integrate/run/core_runs.py).
#pragma once

#include "run/time_loop.hpp"
#include "run/in_place_parameters.hpp"
#include "system/start.hpp"

namespace mbdae {

struct RunStart {
  double ambiguous = 0, fallen = 0, dependent = 0;  // of the rank, see `IndependentRows::InitialRank`
  double shortest = 0;                              // s: first step, at least
  long longest = 0;                                 // steps: longer runs are Python's, which checks them for stiffness

  FIELDS(ambiguous, fallen, dependent, shortest, longest)
};

// Results of runs one after another, in arrays by rows.
struct CoreRuns {
  std::vector<bool> finished;  // otherwise the run is Python's: a step needs it, or a check of its end
  Vector records;   // (n, 13): steps, rejected, counts in the order of `Counts`, largest |g|, |G v + g_t| and |v|
  Vector y;         // (n, nodes, length): some nodes, evenly spread; the last one repeats in short runs
  Vector energies;  // (n, nodes, 2): kinetic and potential energies there, nan where they are Python's
  Vector z;         // (n, nz): last multipliers of the method
  std::vector<std::vector<int>> rows;  // in use at the end
};

// The derivative y' (ny,) and lam (ng,) at the start of a run.
struct StartDerivative {
  Vector F, z;
};
// Begin a run at its state y, which moves onto the closures where ends of steps do; the system is reset before.
// `first_step`: the first step is estimated. `FallBackToPython` as `start`.
StartDerivative begin_run(Index2System& s, const RunStart& start, const FirstStep* first_step, Run& run);

// Runs from points y (n, length), with values (n, ..) of parameters in place, to the end of the span of `run`, which has
// their options and no steps, each begun by `begin_run`. Fewer runs where `stop` becomes true.
void solve_runs(Method& method, Index2System& s, const RunStart& start, const FirstStep* first_step, const Run& run,
                const Vector& y, InPlaceParameters& parameters, const Vector& values, int nodes,
                const volatile unsigned char& stop, CoreRuns& out);

}  // namespace mbdae
