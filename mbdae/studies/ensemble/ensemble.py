"""Many runs of a mechanism in the compiled core: arrays of starts and parameters in, arrays of final states out."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ...arguments import as_numbers
from ...errors import InputError, MbdaeError, UnknownNameError, as_list, require
from ...mechanism import Mechanism
from ...solution.signals import find, units
from ...system import Array
from ..factories import Model, ParametricFactory, factory_of
from ..sweep.sweep_run import NOT_SETTINGS, check_settings
from ..workers import pool
from .batch import EnsembleJob, Starts, batches, run_batch
from .result import Ensemble
from .run_results import RunResults
from .single_runs import complete_in_python

__all__ = ["ensemble"]

Progress = Callable[[float, str], None]


def ensemble(
    model: Model,
    q: Array | None = None,
    v: Array | None = None,
    parameters: Mapping[str, Array] | None = None,
    t_span: float | Sequence[float] | None = None,
    *,
    signals: Sequence[str] | str = (),
    workers: int | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Ensemble:
    """Run a mechanism from many starts and with many values of its parameters; return the final states.

        q' = v,   M(q; p_i) v' = f(t, q, v; p_i) + G^T lam,   0 = G v + g_t,   q(t0) = q_i,  v(t0) = v_i,  i = 1, ..., n

    Runs that need nothing from Python are computed in the compiled core, on several threads, from start to end: their
    results are bitwise those of `mbdae.solve`, whatever the number of threads. `mbdae.solve` then computes the
    remaining runs: on several threads those of mechanisms with modes, flexible or rolling bodies, of other formulations
    than ``"index2"``, close to singular configurations, with more than 2000 steps (which are checked for stiffness) or
    with accuracy warnings; and one after another those that call functions of Python. `Ensemble.in_python` counts them
    by reason. After Ctrl-C, the finished runs are returned; unfinished runs have the status ``"interrupted"``.

    Args:
        model: a mechanism, an argument of `mbdae.load`, or a function of the parameters that returns a Mechanism.
        q: consistent start configurations, (n, nq), or a common one, (nq,); the model's start when left out.
        v: consistent start velocities, (n, nv), or a common one, (nv,); the model's start when left out.
        parameters: name = values, (n,) each; names as for `mbdae.sweep`. The model's start depends on them.
        t_span: end, or start and end in s; from 0 to the model's duration when left out.
        signals: names of signals whose values at the end are returned, see `mbdae.Solution.signals`, of the first
            mechanism that can be constructed.
        workers: threads; one per processor when left out.
        progress: called with the completed fraction and a message.
        settings: arguments of `mbdae.solve`: method, rtol, atol, step, project, ...

    Returns:
        Final states, status and message, counts and signals of all runs.

    Raises:
        UnknownNameError: for a model, parameter, signal or setting that does not exist.
        InputError: for arrays of different lengths, or of the wrong shape. A start that is not consistent, a value of a
            parameter that is not valid, a mechanism without the signals, or a function that fails, is the status
            ``"input"``, ``"assembly"`` or ``"error"`` of its run.
    """
    check_settings(list(settings), excluded=(*NOT_SETTINGS, "events"))
    values = _columns(parameters)
    source = _source(model, values)
    first = source if isinstance(source, Mechanism) else _first_mechanism(source, values)
    starts = _starts(first, q, v, {name: len(x) for name, x in values.items()})
    names = tuple(find(first, as_list(signals, "signals are a list of names")))
    job = EnsembleJob(source, t_span, starts, values, names, settings, RunResults.of(first, starts.n, names))
    job.check(first)
    if _run_in_core(job, workers, progress):
        complete_in_python(job, workers, progress)
    found, known = job.results, units(first) if names else {}
    n, nq = starts.n, first.nq
    return Ensemble(
        first.title, found.t, found.y[:, :nq], found.y[:, nq : nq + first.nv], found.status, found.message,
        found.counts[:, 0], found.counts[:, 1], found.drift, values,
        dict(zip(names, found.signals.reshape(n, -1).T, strict=True)), {x: known[x] for x in names if known[x]},
        found.in_python(),
    )  # fmt: skip


def _run_in_core(job: EnsembleJob, workers: int | None, progress: Progress | None) -> bool:
    """Complete all runs that do not need Python; return False after Ctrl-C."""
    done = [0]

    def report(batch: list[Array], _: None) -> None:
        done[0] += sum(map(len, batch))
        if progress:
            progress(done[0] / job.starts.n, f"{done[0]} of {job.starts.n} runs in the core")

    with suppress(KeyboardInterrupt), pool("threads", workers, run_batch, job, "") as threads:
        threads.run(batches(job, threads.max_pending), report)
        return True
    return False


def _columns(parameters: Mapping[str, Any] | None) -> dict[str, Array]:
    """Return the values of parameters as arrays.

    Raises:
        InputError: for values that are not lists of numbers.
    """
    if parameters is None:
        return {}
    require(parameters, Mapping, "parameters are a table of arrays, name = values")
    out = {}
    for name, values in parameters.items():
        require(name, str, "parameters are named by texts")
        out[name] = as_numbers(values)
        if out[name].ndim != 1:
            raise InputError(f"parameter {name!r} takes one number for each run, got {values!r:.60}")
    return out


def _source(model: object, values: dict[str, Array]) -> Mechanism | ParametricFactory:
    """Return the mechanism, or its factory for several values of its parameters.

    Raises:
        UnknownNameError, InputError: as `mbdae.load`.
    """
    if isinstance(model, Mechanism) and not values:
        return model
    factory = factory_of(model)
    return factory if values else factory.make({})


def _first_mechanism(factory: ParametricFactory, values: dict[str, Array]) -> Mechanism:
    """Return the first mechanism that can be constructed.

    Raises:
        UnknownNameError: for an unknown parameter.
        InputError: if none can be constructed; names the reason for the last one.
    """
    reason = "there are no values"
    for row in zip(*values.values(), strict=False):
        given = {name: x.item() for name, x in zip(values, row, strict=True)}
        try:
            factory.check(given)
            return factory.make(given)
        except UnknownNameError:
            raise
        except MbdaeError as e:
            reason = str(e)
    raise InputError(f"no mechanism can be constructed from these values: {reason}")


def _start_values(name: str, given: object, width: int, title: str) -> Array:
    x = as_numbers(given)
    if not x.ndim:
        raise InputError(f"{name} is an array of numbers, (n, {width}) or ({width},), got {given!r:.60}")
    if x.ndim > 2 or x.shape[-1] != width:
        raise InputError(f"{name} has shape {x.shape}, expected (n, {width}) or ({width},) for {title!r}")
    return x


def _starts(mech: Mechanism, q: object, v: object, lengths: dict[str, int]) -> Starts:
    """Return the starts, after checks of all shapes.

    Raises:
        InputError: for a wrong shape, different lengths, or no array at all.
    """
    arrays: list[Array | None] = []
    for name, given, width in (("q", q, mech.nq), ("v", v, mech.nv)):
        x = None if given is None else _start_values(name, given, width, mech.title)
        arrays.append(x)
        if x is not None and x.ndim == 2:
            lengths = {**lengths, name: len(x)}
    if len(set(lengths.values())) != 1 or not all(lengths.values()):
        text = ", ".join(f"{name} {n}" for name, n in lengths.items()) or "none"
        raise InputError(f"q (n, {mech.nq}), v (n, {mech.nv}) and parameters have a row for each run, got rows: {text}")
    n = next(iter(lengths.values()))
    return Starts(n, *(None if x is None else np.broadcast_to(x, (n, x.shape[-1])) for x in arrays))
