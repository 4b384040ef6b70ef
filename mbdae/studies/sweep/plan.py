"""The runs of a sweep: parameter values from a grid, a list or a random sample, and a seed for each run."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, repeat
from math import prod
from operator import methodcaller
from typing import Any, NamedTuple

import numpy as np

from ...callbacks import call_and_report
from ...errors import InputError, UnknownNameError, is_count
from ..run_columns import pick, pick_rows
from .seeds import run_generators, run_seeds

__all__ = ["Random"]

DISTRIBUTIONS = (  # methods of numpy.random.Generator
    "uniform", "normal", "lognormal", "triangular", "choice", "integers", "exponential", "gamma", "beta", "weibull",
)  # fmt: skip
RANGE = {"from", "to", "n"}
MAX_RUNS = 1_000_000  # largest number of runs, all of which are planned before the first one
BUILTIN = (bool, int, float, str)


@dataclass(frozen=True)
class Random:
    """A random sample of parameters.

    Run i draws its parameters in order from numpy's ``SeedSequence(seed, spawn_key=(i, 0))``: the values depend on the
    seed and on i, not on n or on the worker.

    Attributes:
        n: number of runs.
        parameters: name = distribution. A distribution is a table with the name of a method of numpy.random.Generator
            and its arguments, ``{"distribution": "normal", "loc": 0.35, "scale": 1e-3}``, or, in Python, a frozen
            distribution of scipy.stats; a value that is neither is common to all runs.

    Raises:
        InputError: at the start of the sweep, for an n that is not a positive number, or invalid arguments of a
            distribution.
        UnknownNameError: at the start of the sweep, for an unknown distribution; lists the valid ones.
    """

    n: int
    parameters: Mapping[str, Any]


Parameters = Mapping[str, Sequence[Any]] | Sequence[Mapping[str, Any]] | Random


class Task(NamedTuple):
    """One run: its run number, its seed, and the values of its parameters."""

    run: int
    seed: int
    values: dict[str, Any]


@dataclass(frozen=True)
class Runs:
    """Runs with the same parameters, as columns.

    Attributes:
        run: k run numbers, increasing.
        seeds: k seeds.
        columns: k values of each parameter, by its name.
    """

    run: Sequence[int]
    seeds: Sequence[int]
    columns: dict[str, Sequence[Any]]

    def __len__(self) -> int:
        return len(self.run)

    def __str__(self) -> str:
        return f"batch of runs {self.run[0]} to {self.run[-1]}" if len(self) > 1 else f"run {self.run[0]}"

    def subset(self, which: Sequence[int] | slice) -> "Runs":
        """Return some of the runs, by indices or a slice."""
        return Runs(pick(self.run, which), pick(self.seeds, which), pick_rows(self.columns, which))

    def without(self, done: set[int]) -> "Runs":
        """Return the runs whose numbers are not in ``done``."""
        return self if not done else self.subset([k for k, run in enumerate(self.run) if run not in done])

    def tasks(self) -> Iterator[Task]:
        """Yield the runs one by one."""
        rows = zip(*self.columns.values(), strict=True) if self.columns else repeat(())
        for run, seed, row in zip(self.run, self.seeds, rows, strict=False):
            yield Task(run, seed, dict(zip(self.columns, row, strict=True)))


def planned_runs(parameters: Parameters, seed: int) -> list[Runs]:
    """Return all runs in groups with the same parameters; in a grid the last parameter varies fastest.

    Raises:
        InputError: for parameters that are neither a grid, a list nor a sample, or values that a table cannot store.
        UnknownNameError: for a distribution that does not exist.
    """
    if not is_count(seed, 0):
        raise InputError(f"seed is a whole number, not negative, got {seed!r}")
    if not all(isinstance(name, str) for name in _parameter_names(parameters)):
        raise InputError(f"parameters are named by texts, got {parameters!r:.60}")
    groups = _columns(parameters, int(seed))
    n = sum(len(run) for run, _ in groups)
    if not n:
        raise InputError("a sweep needs at least one run: the list of parameters is empty")
    seeds = run_seeds(int(seed), n)
    return [Runs(run, pick(seeds, run), columns) for run, columns in groups]


def _columns(parameters: Parameters, seed: int) -> list[tuple[Sequence[int], dict[str, Sequence[Any]]]]:
    """Return the run numbers of each group with the same parameters, and the values by parameter."""
    if isinstance(parameters, Mapping):
        axes = {n: _builtin_values(n, _axis_values(n, values)) for n, values in parameters.items()}
        _check_number(n := prod(map(len, axes.values())))
        if not n:
            return []
        return [(range(n), dict(zip(axes, _grid([*axes.values()], n), strict=True)))]
    if isinstance(parameters, Random):
        _check_number(parameters.n)
        return [(range(parameters.n), _sample(parameters, seed))]
    rows, by_names = _listed_runs(parameters), defaultdict[tuple[str, ...], list[int]](list)
    for i, row in enumerate(rows):
        by_names[(*row,)].append(i)
    return [(run, {n: _builtin_values(n, (rows[i][n] for i in run)) for n in key}) for key, run in by_names.items()]


def _grid(axes: Sequence[Sequence[Any]], n: int) -> Iterator[list[Any]]:
    """Yield the column of each axis of a grid with n points, the last of which varies fastest."""
    before, after = 1, n
    for axis in axes:
        after //= len(axis)
        yield [x for x in axis for _ in range(after)] * before
        before *= len(axis)


def _listed_runs(parameters: object) -> Sequence[Mapping[str, Any]]:
    if isinstance(parameters, Sequence) and all(isinstance(p, Mapping) for p in parameters):
        return parameters
    raise InputError(
        "parameters are a grid (name = list of values), a list of tables (name = value), "
        f"or a mbdae.Random, got {parameters!r:.60}"
    )


def _check_number(runs: object) -> None:
    if isinstance(runs, int | np.integer) and runs > MAX_RUNS:
        raise InputError(f"a sweep has at most {MAX_RUNS} runs, got {runs}")


def _parameter_names(parameters: object) -> Iterable[Any]:
    """Return the keys of random values or of runs, which must be names of parameters."""
    if isinstance(parameters, Random):
        return parameters.parameters if isinstance(parameters.parameters, Mapping) else [None]
    runs = [parameters] if isinstance(parameters, Mapping) else parameters
    runs = runs if isinstance(runs, Sequence) and not isinstance(runs, str) else []
    return (name for run in runs if isinstance(run, Mapping) for name in run)


def names(plan: Iterable[Runs]) -> list[str]:
    """Return the names of all parameters, in order."""
    return list(dict.fromkeys(chain.from_iterable(runs.columns for runs in plan)))


def _builtin_values(name: str, values: Iterable[object]) -> list[Any]:
    return [x if type(x) in BUILTIN else builtin_value(name, x) for x in values]


def builtin_value(name: str, value: object) -> Any:
    """Return a value as a number, text, Boolean or list of numbers.

    Raises:
        InputError: for any other value.
    """
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, BUILTIN):
        return value
    if isinstance(value, list | tuple | np.ndarray) and len(value):
        inner = [builtin_value(name, x) for x in value]
        if all(isinstance(x, int | float) and not isinstance(x, bool) for x in inner):
            with suppress(OverflowError):
                return [float(x) for x in inner]
    raise InputError(f"parameter {name!r} takes numbers, texts or lists of numbers, got {value!r:.60}")


def _axis_values(name: str, values: object) -> Sequence[Any]:
    """Return the values of one axis of a grid."""
    if isinstance(values, Mapping) and set(values) == RANGE:
        _check_number(values["n"])
        try:
            return np.linspace(values["from"], values["to"], values["n"]).tolist()
        except (TypeError, ValueError, OverflowError) as e:
            raise InputError(f"{name}: from and to are numbers, and n is a number, got {dict(values)}: {e}") from None
    found = values.tolist() if isinstance(values, np.ndarray) else values
    if isinstance(found, str | Mapping) or not isinstance(found, Sequence) or not len(found):
        raise InputError(f"{name}: a grid takes a list of values, or from, to and n, got {values!r:.60}")
    return list(found)


def _sample(random: Random, seed: int) -> dict[str, Sequence[Any]]:
    """Return the values of all runs by parameter; each run draws one parameter after another."""
    if isinstance(random.n, bool) or not isinstance(random.n, int | np.integer) or random.n < 1:
        raise InputError(f"n, the number of runs of a random sample, is a positive number, got {random.n!r}")
    samplers = [_sampler(name, value) for name, value in random.parameters.items()]
    rows = ([draw(rng) for draw in samplers] for rng in run_generators(seed, random.n))
    columns = zip(*rows, strict=True) if samplers else ()
    return {name: _builtin_values(name, x) for name, x in zip(random.parameters, columns, strict=True)}


def _sampler(name: str, value: object) -> Callable[[np.random.Generator], Any]:
    """Return a function that draws a value of one parameter."""
    if hasattr(value, "rvs"):
        return lambda rng: call_and_report(f"distribution of {name}", lambda: value.rvs(random_state=rng))
    if not isinstance(value, Mapping):
        return lambda rng: value
    arguments = dict(value)
    kind = arguments.pop("distribution", None)
    if kind not in DISTRIBUTIONS:
        raise UnknownNameError(f"distribution of {name}", str(kind), DISTRIBUTIONS)
    try:
        draw = methodcaller(kind, **arguments)
        draw(np.random.default_rng(0))
    except (TypeError, ValueError, OverflowError) as e:
        raise InputError(f"{name}: numpy's {kind} does not take {arguments}: {e}") from None
    return draw
