"""Parameter sweeps: a table of the runs of a model for many values of its parameters."""

import hashlib
import json
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, suppress
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from ...backend import checked_backend, select_core
from ...discovery import is_model_name
from ...errors import InputError, MbdaeError, UnknownNameError
from ...integrate.options.defaults import DEFAULTS
from ...integrate.options.span import checked_span
from ...integrate.steppers.solvers import find_method
from ...mechanism import Mechanism, describe
from ...mechanism.formats.mechanism_file.parameter_units import parameter_units
from ...mechanism.formats.mechanism_file.parametric import split as split_name
from ...mechanism.imported_model import not_carried_over
from ...solution.provenance import versions
from ..factories import Model, ParametricFactory, model_title, with_tables_loaded
from ..workers import pool
from .fingerprint import fingerprint
from .outputs import Output, check, label, parse
from .plan import Parameters, Runs, names, planned_runs
from .result_collector import ResultCollector
from .sweep_batch import batches_of, run_batch
from .sweep_run import SOLVE, Job, check_settings, known_signals, split
from .table import Sweep, column_kinds

__all__ = ["sweep"]

Progress = Callable[[float, str], None]
TRIALS = 50  # number of first runs, and about that of later ones, of which one must have a valid mechanism
MAX_TIMES = 1_000_000  # largest number of times of a run


def sweep(
    model: Model,
    parameters: Parameters,
    t_span: float | Sequence[float] | None = None,
    *,
    outputs: Sequence[Output] = (),
    times: int | Sequence[float] | np.ndarray | None = None,
    path: str | Path | None = None,
    seed: int = 0,
    executor: str | Executor | None = None,
    workers: int | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
    **settings: Any,
) -> Sweep:
    """Run a model for many values of its parameters.

    A parameter is named by

    * its name, for a ``mechanism.py`` or a function that takes it;
    * a dotted path into the mechanism file: ``"force.spring.stiffness"``, ``"frame.rod_tip.xyz.0"``,
      ``"body.rod.mass"``, ``"gravity.2"``, ``"start.v.crank"``;
    * ``"joint.crank_pin.xyz.0"`` for a joint of a URDF or MJCF file: ``xyz`` and ``rpy`` of its placement in the parent
      body, ``mass``, ``com``, ``inertia`` of the child body;
    * ``"solve.rtol"`` for an argument of `mbdae.solve`.

    Unknown names are rejected before any run. A failed run (an invalid value, no consistent start, a status of
    `mbdae.solve`) is a row with that status and its message. The table is bitwise the same for threads, processes and
    clusters.

    With ``path`` each finished run is stored in ``runs.parquet.part``, and the complete table in ``runs.parquet``. The
    same call resumes after an interruption or a crash. After Ctrl-C it returns the finished runs.

    Args:
        model: a mechanism that was loaded, an argument of `mbdae.load`, or a function of the parameters that returns a
            Mechanism. For processes a function must be importable, and scripts need ``if __name__ == "__main__":``.
        parameters: a grid, name = list of values (all combinations); a list of runs, name = value each; or a
            `mbdae.Random` sample.
        t_span: end, or start and end in s; from 0 to the model's duration when left out.
        outputs: results of each run, see `mbdae.studies.sweep.outputs`: ``"q.slider"`` a signal at the times,
            ``"final q.slider"``, ``"peak force.wrist pin"``, or functions of the Solution that return a table. A signal
            that some mechanisms do not have is missing in their runs.
        times: number of equidistant times, or the times, at which signals are taken; the ends of steps when left out.
        path: file of the table, ``.parquet``; needs pyarrow.
        seed: seed of the sweep, which with the number of a run determines its seed; a parameter ``seed`` of the model
            has that value.
        executor: threads when left out, with the core; else processes. ``"threads"``, ``"processes"`` or any executor
            of concurrent.futures: that of a Dask client (``client.get_executor()``) or of ``mpi4py.futures``. It
            receives batches of runs that take about `mbdae.studies.sweep.sweep_batch.BATCH_SECONDS`, or single runs.
        workers: number of threads or processes; when left out one per processor, or the number that an executor
            reports.
        fresh: do not resume from the file, but replace it.
        progress: called with the completed fraction and a message.
        settings: arguments of `mbdae.solve`.

    Returns:
        The table, a row for each run.

    Raises:
        UnknownNameError: for a model, parameter, signal or setting that does not exist.
        InputError: for wrong arguments, a model that cannot be constructed with any of the values, or the file of
            another sweep.
        MbdaeError: if a worker fails; finished runs are stored.
    """
    if path is not None and not isinstance(path, str | Path):
        raise InputError(f"path is the name of a file, got {path!r:.60}")
    check_backend = checked_backend if isinstance(executor, Executor) else select_core  # which may use other machines
    check_backend(settings.get("backend", "auto"))
    plan = planned_runs(parameters, seed)
    job = _job(model, t_span, times, outputs, settings)
    mech = _checked(job, plan)
    known = known_signals(job, plan, mech)
    check(known, job.outputs, job.times is not None)
    meta = _meta(job, plan, mech, known)
    job.runs, job.columns, job.key = meta["manifest"]["runs"], tuple(meta["kinds"]), json.dumps(meta["manifest"])
    with closing(ResultCollector(meta, None if path is None else Path(path), fresh, progress)) as collector:
        _run(job, [runs.without(collector.done) for runs in plan], executor, workers, collector)
        return collector.finish()


def _run(
    job: Job, plan: list[Runs], executor: str | Executor | None, workers: int | None, collector: ResultCollector
) -> None:
    """Execute runs in batches until Ctrl-C."""
    if not any(map(len, plan)):
        return
    with suppress(KeyboardInterrupt), pool(executor, workers, run_batch, job, "executor='threads'") as workers_pool:
        batches = batches_of(plan, workers_pool.max_pending, collector.seconds)
        workers_pool.run(batches, collector.record)


def _meta(job: Job, plan: Sequence[Runs], mech: Mechanism, known: Mapping[str, str]) -> dict[str, Any]:
    """Return the metadata of a table, see `Sweep`."""
    parsed = [parse(x) for x in job.outputs if isinstance(x, str)]
    numbers, samples = ([p.text for p in parsed if bool(p.reduction) is scalar] for scalar in (True, False))
    kinds, swept = column_kinds(plan, numbers, samples), names(plan)
    numeric = [n for n in swept if kinds.get(n) in ("float", "int") and not n.startswith(SOLVE)]
    column_units = parameter_units(job.factory, numeric) | {p.text: p.unit(known) for p in parsed}
    return {
        "manifest": _manifest(job, plan, mech),
        "kinds": kinds,
        "parameters": swept,
        "outputs": numbers,
        "samples": samples,
        "units": {name: unit for name, unit in column_units.items() if unit},
    }


def _job(model: Model, t_span: object, times: object, outputs: Sequence[Output], settings: dict[str, Any]) -> Job:
    """Return the job after checks that need no mechanism."""
    if isinstance(outputs, str) or not isinstance(outputs, Sequence):
        raise InputError(f"outputs is a list of texts and functions, got {outputs!r:.60}")
    check_settings(list(settings))
    span = None if t_span is None else checked_span(t_span)
    return Job(_absolute_path(model), span, _times(times), tuple(outputs), settings)


def _absolute_path(model: Model) -> Model:
    """Return an absolute path, and tables as a mechanism, for processes that run in other folders."""
    model = with_tables_loaded(model)
    if not isinstance(model, str | Path):
        return model
    file, _ = split_name(str(model))
    if is_model_name(file) or not Path(file).exists():
        return str(model)
    return str(Path(file).resolve()) + str(model)[len(file) :]


def _times(times: Any) -> int | tuple[float, ...] | None:
    if times is None:
        return None
    if isinstance(times, int | np.integer) and not isinstance(times, bool):
        if not 2 <= times <= MAX_TIMES:
            raise InputError(
                f"times is a number of times, at least 2 and at most {MAX_TIMES}, or the times, got {times}"
            )
        return int(times)
    try:
        found = tuple(float(t) for t in times)
    except (TypeError, ValueError):
        found = ()
    if not found or not np.isfinite(found).all() or len({*np.sign(np.diff(found)).tolist()} - {0.0}) > 1:
        raise InputError(f"times is a number of times, or the times in the span's order, got {times!r:.60}")
    return found


def _checked(job: Job, plan: Sequence[Runs]) -> Mechanism:
    """Reject unknown names; return the mechanism of the first run for which one can be constructed.

    Raises:
        UnknownNameError, InputError: as `sweep`.
    """
    check_settings(sorted(name.removeprefix(SOLVE) for name in names(plan) if name.startswith(SOLVE)))
    for formulation, method in _methods(job, plan):
        find_method(formulation, method)
    mech = _first_mechanism(job.factory, plan)
    if mech.remarks:
        warnings.warn(not_carried_over(mech.title, mech.remarks), stacklevel=3)
    return mech


def _first_mechanism(factory: ParametricFactory, plan: Sequence[Runs]) -> Mechanism:
    """Check the names of all parameters; return the first mechanism that can be constructed."""
    checked = set[tuple[str, ...]]()
    mech, problem = None, ""
    sample = [*chain.from_iterable(runs.subset(_sample(len(runs))).tasks() for runs in plan)]
    for task in sample:
        values, _ = split(task.values, factory, task.seed)
        if mech is not None and tuple(values) in checked:
            continue
        try:
            factory.check(values, (f"{SOLVE} ...",))
            checked.add(tuple(values))
            mech = mech or _make(factory, values)
        except UnknownNameError:
            raise
        except Exception as e:
            problem = str(e) if isinstance(e, MbdaeError) else f"{type(e).__name__}: {e}"
    if mech is None:
        tried = f"({len(sample)} runs were tried)"
        raise InputError(f"no mechanism can be constructed from these values {tried}: {problem}")
    return mech


def _sample(n: int) -> list[int]:
    return [*range(n)[:TRIALS], *range(n)[TRIALS :: max(1, n // TRIALS)]]


def _make(factory: ParametricFactory, values: Mapping[str, Any]) -> Mechanism:
    try:
        return factory.make(values)
    except UnknownNameError as e:  # a value may be a name, for instance of a frame
        raise InputError(str(e)) from e


def _methods(job: Job, plan: Sequence[Runs]) -> Iterable[tuple[str, str]]:
    """Return the formulations and methods of the runs."""
    found = dict[str, tuple[str, str]]()
    for runs in plan:
        n = len(runs) if {SOLVE + "formulation", SOLVE + "method"} & {*runs.columns} else 1
        columns = (
            [x or DEFAULTS[key] for x in runs.columns.get(SOLVE + key, [job.settings.get(key)] * n)]
            for key in ("formulation", "method")
        )
        found |= {repr(pair): pair for pair in zip(*columns, strict=True)}
    return found.values()


def _manifest(job: Job, plan: Sequence[Runs], mech: Mechanism) -> dict[str, Any]:
    """Return data that identify a sweep; long entries as checksums."""
    description = describe(mech) if isinstance(job.model, str | Mechanism) else fingerprint(job.model)
    return {
        "model": model_title(job.model),
        "mechanism": _checksum(description),
        "runs": sum(map(len, plan)),
        "parameters": _checksum([[*runs.run, *runs.seeds, [*runs.columns.items()]] for runs in plan]),
        "t_span": job.t_span and list(job.t_span),
        "times": list(job.times) if isinstance(job.times, tuple) else job.times,
        "outputs": [label(x) for x in job.outputs],
        "settings": json.loads(json.dumps(job.settings, default=_as_data)),
        "functions": _checksum([[fingerprint(x) for x in job.outputs if callable(x)], fingerprint(job.settings)]),
        "version": versions()["mbdae"],
    }


def _as_data(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else label(value)


def _checksum(data: object) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
