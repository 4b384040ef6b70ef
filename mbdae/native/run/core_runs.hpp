// Complete runs in the core without Python: start, first step, steps to the end (mbdae/integrate/run/core_runs.py).
#pragma once

#include "run/time_loop.hpp"
#include "run/in_place_parameters.hpp"
#include "system/start.hpp"

namespace mbdae {

struct RunStart {
  double ambiguous = 0, fallen = 0, dependent = 0;  // thresholds of the rank, see `IndependentRows::InitialRank`
  double shortest = 0;                              // s: smallest first step
  long longest = 0;                                 // steps: Python takes over longer runs, to check them for stiffness

  FIELDS(ambiguous, fallen, dependent, shortest, longest)
};

// Results of n runs, in arrays by rows.
struct CoreRuns {
  std::vector<bool> finished;  // false: Python must repeat the run, for one of its steps or for the check of its end
  Vector records;   // (n, 13): steps, rejected, counts in the order of `Counts`, largest |g|, |G v + g_t| and |v|
  Vector y;         // (n, nodes, length): some nodes, evenly spaced; the last one is repeated in short runs
  Vector energies;  // (n, nodes, 2): kinetic and potential energies at these nodes, nan if they require Python
  Vector z;         // (n, nz): last multipliers of the method
  std::vector<std::vector<int>> rows;  // in use at the end
};

// The derivative y' (ny,) and lam (ng,) at the start of a run.
struct StartDerivative {
  Vector F, z;
};
// Reset the system and begin a run at its state y, which is projected if the ends of steps are. `first_step`: settings
// to estimate the first step size, or null. Throws FallBackToPython like `start`.
StartDerivative begin_run(Index2System& s, const RunStart& start, const FirstStep* first_step, Run& run);

// Solve the runs from points y (n, length), with parameter values (n, count) written in place, to the end of the span
// of `run`, which has their options and no steps. Stops after fewer runs if `stop` becomes true.
void solve_runs(Method& method, Index2System& s, const RunStart& start, const FirstStep* first_step, const Run& run,
                const Vector& y, InPlaceParameters& parameters, const Vector& values, int nodes,
                const volatile unsigned char& stop, CoreRuns& out);

}  // namespace mbdae
