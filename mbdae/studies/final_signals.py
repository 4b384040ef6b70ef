"""Signals at the end of runs that were solved in the core."""

from collections.abc import Sequence

import numpy as np

from ..errors import UnknownNameError
from ..integrate.run.core_runs import CoreRuns, reason_for_python
from ..integrate.run.run_state import RunState
from ..mechanism import Mechanism
from ..solution.signal_value import RESIDUALS, RUN_PREFIXES, signal_values
from ..solution.signals import signals
from ..solution.solution import Solution
from ..system import Array

KINEMATIC_KINDS = ("t", "y", "position", "gap", *RESIDUALS)  # kinds of signals that need no masses and forces


def reason_not_in_core(run: RunState, names: Sequence[str]) -> str:
    """Return why runs with these signals need Python, for example a signal that depends on the whole run.

    Args:
        run: one of the runs, before its first step.
        names: names of the signals.

    Raises:
        UnknownNameError: for a signal that the mechanism does not have.
    """
    known = signal_values(run.problem) if names and isinstance(run.problem, Mechanism) else {}
    if unknown := [name for name in names if name not in known]:
        raise UnknownNameError("signal", unknown[0], known)
    of_a_run = (name for name in names if known[name].kind == "column" and name.partition(".")[0] in RUN_PREFIXES)
    unwrapped = (name for name in names if known[name].kind == "angle")
    return next((f"signal {name!r}" for name in (*of_a_run, *unwrapped)), "") or reason_for_python(run)


def need_only_kinematics(mech: Mechanism, names: Sequence[str]) -> bool:
    """Return whether signals follow from t, q, v, s and geometry, without masses and forces."""
    known = signal_values(mech)
    return all(name in known and known[name].kind in KINEMATIC_KINDS for name in names)


def signals_at_end(run: RunState, runs: CoreRuns, names: Sequence[str]) -> Array:
    """Return signals at the end of the finished runs, (k, signals), by a solution whose nodes are the final states."""
    done = np.flatnonzero(runs.finished)
    if not names or not len(done):
        return np.empty((len(done), len(names)))
    rows = [runs.rows[k] for k in done]
    in_use = [(k, x) for k, x in enumerate(rows) if not k or x != rows[k - 1]]
    ends = np.full(len(done), run.options.t1), runs.y[done], runs.z[done]
    stats = {"backend": run.stepper.backend}
    sol = Solution(run.problem, *ends, "finished", "", stats, {}, in_use=in_use)
    found = signals(sol, names)
    return np.array([found[name] for name in names]).T
