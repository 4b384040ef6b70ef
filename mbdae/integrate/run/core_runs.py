"""Complete runs of a mechanism in the compiled core, from many starts, if no run needs Python.

The core begins each run, estimates its first step and takes all steps by the same functions as `mbdae.solve`: results
are bitwise equal. A run that needs Python in between, or that may be inaccurate, is left to `mbdae.solve`, which
produces the warnings and messages.
"""

from typing import NamedTuple

import numpy as np

from ...errors import InputError, StepError
from ...mechanism import Mechanism
from ...mechanism.closures.preconditions import closures_with_preconditions
from ...mechanism.formulations.compiled_systems import CompiledSystem
from ...mechanism.run_parameters import RunParameters
from ...mechanism.signals.contacts import rolling_closures
from ...mechanism.tree.tree_terms import flexible_bodies
from ...methods import Tableau
from ...system import Array, Counts
from ...tolerances import INPUT_DIGITS
from ..options.options import RunOptions
from ..steppers.native import NativeStepper
from ..steppers.stepper import smallest_step
from .run_diagnostics import SAMPLES, are_accurate
from .run_setup import START_DRIFT
from .run_state import RunState
from .skipped_shapes import closures_with_curves, tables_over_time
from .stiffness_detection import FIRST_CHECK

COUNTS = ("steps", "rejected", *Counts().to_dict())
UNLIMITED = 2**31 - 1  # steps


class CoreRuns(NamedTuple):
    """The first k of several runs in the core.

    Attributes:
        finished: whether each run finished in the core, (k,); other runs are left to `mbdae.solve`.
        counts: `COUNTS` of each run, (k, 10).
        drift: largest |g| at the ends of steps, in rad or characteristic lengths, (k,).
        y: last points, (k, n).
        z: last multipliers of the method, (k, nz).
        rows: last rows in use.
    """

    finished: Array
    counts: Array
    drift: Array
    y: Array
    z: Array
    rows: list[tuple[int, ...]]


def reason_for_python(run: RunState) -> str:
    """Return why runs of a mechanism with these options need Python; empty if they do not.

    Args:
        run: one of the runs, before it begins.
    """
    mech, options, system = run.problem, run.options, run.system
    if not isinstance(mech, Mechanism) or not isinstance(system, CompiledSystem):
        return run.fallback or "the Python back end"
    if not isinstance(run.stepper, NativeStepper):
        return f"method {options.method.name!r}"
    if options.formulation != "index2":
        return f"formulation {options.formulation!r}"
    if options.t0 == options.t1:
        return "an empty time span"
    return _feature_in_python(mech, system) or _driver_in_python(mech, options)


def calls_python(run: RunState) -> bool:
    """Return whether evaluations of a run, before it begins, call Python functions."""
    return not isinstance(run.system, CompiledSystem) or run.system.core.calls_python


def _feature_in_python(mech: Mechanism, system: CompiledSystem) -> str:
    """Return a feature of the mechanism that needs Python at the start, between steps or at the end; else ''."""
    closures = [*closures_with_preconditions(mech), *rolling_closures(mech), *closures_with_curves(mech)]
    features = {
        "modes of": [s.name for s in mech.switches],
        "event": [reset.name for reset in mech.resets],
        "closure friction": [interface.force.name for interface in system.closure_friction.interfaces],
        "flexible body": [body.name for body in flexible_bodies(mech.model)],
        "checks of closure": [c.name for c in closures],
        "table of": [name for name, _ in tables_over_time(system)],
    }
    feature = next((f"{kind} {names[0]!r}" for kind, names in features.items() if names), "")
    return feature or ("functions of Python" if system.core.calls_python else "")


def _driver_in_python(mech: Mechanism, options: RunOptions) -> str:
    if options.end != options.t1:
        return "the end of the table of a driver"
    try:
        for driver in mech.drivers:
            driver.check_run(options.t0, options.end)
    except StepError as e:
        return str(e)
    return ""


def _in_core(run: RunState) -> tuple[Mechanism, CompiledSystem, NativeStepper]:
    """Return mechanism, workspace and stepper of a run that does not need Python."""
    assert isinstance(run.problem, Mechanism)
    assert isinstance(run.system, CompiledSystem)
    assert isinstance(run.stepper, NativeStepper)
    return run.problem, run.system, run.stepper


def consistent_starts(run: RunState, y: Array, parameters: RunParameters) -> Array:
    """Return whether points are consistent starts, by the criteria of `mbdae.solve`, (k,).

    Args:
        run: a run of the mechanism, before it begins.
        y: the points, (k, n).
        parameters: parameters of each run; if there are any, the characteristic rate, which depends on them, is not
            used to allow violations.
    """
    (mech, system, _), options = _in_core(run), run.options
    tolerance = max(INPUT_DIGITS, 0.0 if options.step else START_DRIFT * float(options.rtol))
    valid = np.isfinite(y).all(axis=1)
    if not mech.manifold.flat:
        valid[valid] = [_is_configuration(mech, q) for q in y[valid, : system.nq]]
    if not mech.ng:
        return valid
    g, rates, _ = system.residuals(np.full(len(y), options.t0), y)
    speed = np.abs(y[:, system.nq : system.nq + system.nv] / mech.coordinate_scales).max(axis=1)
    gaps, rate_violations = (_largest_violation(mech, x) for x in (g, rates))
    is_slow = rate_violations > tolerance * speed
    limit = tolerance * (speed + (mech.characteristic_rate if is_slow.any() and not parameters.locations else 0.0))
    return valid & (gaps <= tolerance) & (rate_violations <= limit)


def _is_configuration(mech: Mechanism, q: Array) -> bool:
    try:
        mech.configuration(q)
    except InputError:
        return False
    return True


def _largest_violation(mech: Mechanism, residuals: Array) -> Array:
    """Return the largest norm of the rows of a closure, in rad and characteristic lengths, of residuals (k, ng)."""
    scaled = residuals / mech.row_scales
    return np.max([np.linalg.norm(scaled[:, mech.rows_of(c.name)], axis=1) for c in mech.constraints], axis=0)


def supports_parameters_in_place(options: RunOptions) -> bool:
    """Return whether parameters can differ between runs in the core: not for methods with partials (a second tree)."""
    return isinstance(options.method, Tableau)


def solve_in_core(run: RunState, y: Array, stop: Array, parameters: RunParameters | None = None) -> CoreRuns:
    """Solve runs from several starts in the core, as many as possible before a flag is set.

    Args:
        run: a run of the mechanism, before it begins; another thread may not use it. See `reason_for_python`.
        y: starts, (k, n).
        stop: the flag, (1,) of type uint8, which another thread may set.
        parameters: parameters of each run; then the mechanism belongs to this thread. See
            `supports_parameters_in_place`.
    """
    (_, system, stepper), options = _in_core(run), run.options
    core, native, control = stepper.core_run_before_start(run), system.native, stepper.control
    core.max_steps = options.max_steps or UNLIMITED
    detects_stiffness = control and isinstance(options.method, Tableau)
    if system.ns:  # controllers may sample at the start
        y = np.array([run.jumps.adjust_point(run, point) for point in y])
    start = system.run_start(smallest_step(run.t, run.t1), FIRST_CHECK - 1 if detects_stiffness else UNLIMITED)
    first = native.FirstStep(**control.first_step_data(run)) if control and control.h is None else None
    method, parameters = system.method(options.method), parameters or RunParameters()
    locations = [native.ParameterLocation(**x) for x in parameters.locations]
    values = parameters.values
    results = system.core.solve_runs(method, start, first, core, y, locations, values, SAMPLES + 1, stop)
    ended, records, points, energies, z, rows = results
    counts, extremes = np.split(records.reshape(-1, len(COUNTS) + 3), [len(COUNTS)], axis=1)
    finished = np.array(ended, bool) & are_accurate(extremes, energies, points[..., -1])
    return CoreRuns(finished, counts.astype(int), extremes[:, 0], points[:, -1], z, list(map(tuple, rows)))
