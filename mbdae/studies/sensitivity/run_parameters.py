"""Parameters of a mechanism, by dotted names, with respect to which runs are differentiated."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from numbers import Real
from threading import get_ident
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ... import backend
from ...callbacks import call_and_report
from ...errors import InputError, StepError, UnknownNameError, is_number, require
from ...integrate.trajectory.differentiable_runs import require_differentiable
from ...integrate.trajectory.trajectory import Trajectory
from ...mechanism import Mechanism
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.forces.elements import coincident
from ...mechanism.formats.mechanism_file.loaded_model import parameter_value
from ...mechanism.formats.mechanism_file.template import Template
from ...mechanism.tree.frames import Pair, anchor_paths
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import COINCIDENT
from ..factories import FunctionFactory, MechanismFactory, factory_of

_BOUND: WeakKeyDictionary[Mechanism, dict[Any, Parameters]] = WeakKeyDictionary()
"""Cache of the last parameters of each mechanism; their workspaces belong to one thread."""

CHECKS = 9  # number of points of a run at which parameters are checked
HALVINGS = 16  # largest number of halvings of a step over which a direction changes by more than 90 degrees

Names = Sequence[str] | Mapping[str, float]
Model = Any  # str | Path | MechanismFactory | Callable[..., Mechanism] | None


class VaryingParameters:
    """Parameters of runs that differ in their values: bound for the first run, then written in place where possible.

    Args:
        factory: factory of the mechanisms.

    Attributes:
        bound: number of times that parameters were bound: once more for each run whose values change directions.
    """

    def __init__(self, factory: MechanismFactory) -> None:
        self.factory, self.bound = factory, 0
        self._last: Trajectory | None = None

    def trajectory(self, sol: Solution, values: Mapping[str, float]) -> Trajectory:
        """Return the trajectory of a run with these values; it is valid until the next one is requested.

        Raises:
            UnknownNameError, InputError: as `bind_parameters`.
        """
        if self._last is None or self._last.sol is not sol:
            parameters = self._last and self._last.core.varied
            if parameters and parameters.write(values):
                _require_directions(parameters, sol)
            else:
                parameters, self.bound = bind_parameters(sol, values, self.factory), self.bound + 1
            self._last = Trajectory(sol, parameters)
        return self._last


def bind_parameters(sol: Solution, names: Names, model: Model) -> Parameters:
    """Return the parameters of a run, for derivatives; reject those that violate dependent rows at its start.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for a run without derivatives, a name without a number, a parameter without a derivative, or a force
            of undefined direction.
    """
    require_differentiable(sol)
    parameters = _cached_parameters(sol, names, model)
    _require_directions(parameters, sol)
    return parameters


def _require_directions(parameters: Parameters, sol: Solution) -> None:
    parameters.require_directions(float(sol.nodes[0][0]), sol.nodes[1][0][: sol.mechanism.nq])
    reversing = [(law.name, law.reversing_pair) for law, _ in parameters.system.laws.bound if law.reversing_pair]
    if not reversing:
        return
    gaps = _gaps([pair for _, pair in reversing], sol.nodes[1][:, : sol.mechanism.nq])
    for (name, pair), x in zip(reversing, gaps, strict=True):
        if _passes(sol, pair, x):
            raise coincident(name)


def _gaps(pairs: Sequence[Pair], q: Array) -> Array:
    """Return the vectors between the origins of pairs of frames in m, (n, m, 3), at configurations q (m, nq)."""
    paths = anchor_paths(pairs[0].model, [x for pair in pairs for x in (pair.a, pair.b)], q)
    return paths[1::2] - paths[::2]


def _passes(sol: Solution, pair: Pair, x: Array) -> bool:
    """Return whether the origins of two frames, with difference vectors x at the nodes, coincide during a run.

    Then the direction of their line reverses abruptly, instead of by a rotation within some steps.
    """

    def skips(start: float, end: float, a: Array, b: Array, halvings: int) -> bool:
        if a @ b > 0 or start == end:
            return False
        if not halvings:
            return True
        middle = (start + end) / 2
        ((x,),) = _gaps([pair], np.atleast_2d(sol(middle).q))
        return skips(start, middle, a, x, halvings - 1) or skips(middle, end, x, b, halvings - 1)

    t = sol.nodes[0]
    reversals = np.flatnonzero(np.einsum("ij,ij->i", x[1:], x[:-1]) <= 0)
    return any(skips(t[i], t[i + 1], x[i], x[i + 1], HALVINGS) for i in reversals)


def _cached_parameters(sol: Solution, names: Names, model: Model) -> Parameters:
    mech, t, y = sol.mechanism, float(sol.nodes[0][0]), sol.nodes[1][0]
    if isinstance(names, Collection) and not isinstance(names, str) and not names:
        return Parameters(lambda values: mech, {})
    key = get_ident(), t, float(sol.nodes[0][-1]), sol.mode(0), repr(names)
    if model is None and key in _BOUND.get(mech, {}):
        return _BOUND[mech][key]
    parameters = _bound(sol, names, factory_of(mech if model is None else model))
    if isinstance(names, Mapping) or model is not None:
        _require_same_motion(parameters.mech, sol)
    if parameters.mech.ng:
        parameters.require_consistent(t, y[: mech.nq])
    if model is None:
        _BOUND[mech] = {key: parameters}
    return parameters


def _bound(sol: Solution, names: Names, factory: MechanismFactory) -> Parameters:
    values, mech, (ts, ys) = named_values(factory, names), sol.mechanism, sol.nodes[:2]
    from_file = isinstance(factory, Template) and not isinstance(names, Mapping)
    cuts = np.cumsum([mech.nq, mech.nv, len(mech.states)])
    indices = np.linspace(0, len(ts) - 1, CHECKS).round().astype(int)
    points = [(i, *np.split(ys[i], cuts)[:3]) for i in np.unique(indices).tolist()]
    along = [(float(ts[i]), q, v, s, sol.mode(i)) for i, q, v, s in points]
    parameters = Parameters(factory.make, values, backend.load(), are_defaults=from_file, along=along)
    _require_same_structure(mech, parameters.mech)
    return parameters


def named_values(factory: MechanismFactory, names: Names) -> dict[str, float]:
    """Return the parameters by name, with their values.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for an invalid or repeated name, or one without a number.
    """
    if isinstance(names, str) or not isinstance(names, Collection):
        raise InputError(f"parameters are a list of names, or name = value, got {names!r:.60}")
    for i, name in enumerate(name_list := list(names)):
        if not isinstance(name, str):
            raise InputError(f"parameters have dotted names, as 'gravity.2' or 'joint.crank.mass', got {name!r:.60}")
        if name in name_list[:i]:
            raise InputError(f"parameter {name!r} is named twice")
    if isinstance(names, Mapping):
        if isinstance(factory, FunctionFactory):
            factory.check(names)
        return {name: _value(name, value) for name, value in names.items()}
    if not isinstance(factory, Template):
        raise InputError("the parameters of a function that makes a mechanism are given as name = value")
    return {name: parameter_value(factory, name) for name in name_list}


def checked_scales(given: Any, default: Mapping[str, float]) -> Array:
    """Return the typical changes of parameters, (k,), by default those of ``default``.

    Raises:
        UnknownNameError: for an unknown parameter.
        InputError: for a scale that is not a positive number.
    """
    require(given if given is not None else {}, Mapping, "scales are a table, name = size")
    for name, x in (given or {}).items():
        if name not in default:
            raise UnknownNameError("parameter", name, default)
        if not (is_number(x) and x > 0):
            raise InputError(f"the scale of parameter {name!r} is a positive number, got {x!r:.60}")
    return np.array([float(x) for x in {**default, **(given or {})}.values()])


def progress_reporter(progress: object) -> Callable[[str], None]:
    """Return a function that calls the user's progress function, or does nothing for None.

    Raises:
        InputError: for anything but a function, or if it fails.
    """
    if progress is None:
        return lambda text: None
    if not callable(progress):
        raise InputError(f"progress is a function of a text, got {progress!r:.60}")
    return lambda text: call_and_report("progress", lambda: progress(text))


def entries(given: object) -> list[Any]:
    """Return the entries of a list, tuple or array; an empty list for anything else, as an array of shape ()."""
    return list(given) if isinstance(given, list | tuple) or (isinstance(given, np.ndarray) and given.ndim) else []


def reals(given: object) -> list[float]:
    """Return the numbers of a list, which may be infinite; an empty list for anything else."""
    listed = entries(given)
    valid = all(isinstance(x, Real) and not isinstance(x, bool) and not np.isnan(float(x)) for x in listed)
    return [float(x) for x in listed] if valid else []


def _value(name: str, value: object) -> float:
    if not is_number(value):
        raise InputError(f"the value of parameter {name!r} is a finite number, got {value!r:.60}")
    return float(value)


def _require_same_structure(mech: Mechanism, other: Mechanism) -> None:
    """Require that a mechanism made with the values has the structure of the mechanism of the run.

    Raises:
        InputError: if the structures differ.
    """
    same = [(m.nq, m.nv, m.ng, list(m.states), m.joint_names) for m in (mech, other)]
    if same[0] != same[1]:
        raise InputError("the model makes a mechanism that differs from the one that ran")


def _require_same_motion(other: Mechanism, sol: Solution) -> None:
    """Require that a mechanism has the accelerations of a run at start and end, if they can be computed.

    Raises:
        InputError: if they differ.
    """
    for i in (0, -1):
        t, y = float(sol.nodes[0][i]), sol.nodes[1][i]
        with suppress(StepError):
            expected, found = (m.system().derivative(t, y)[0] for m in (sol.mechanism, other))
            if np.abs(found - expected).max() > COINCIDENT * (1 + np.abs(expected).max()):
                raise InputError("with these values the model moves differently from the run: give those of the run")
