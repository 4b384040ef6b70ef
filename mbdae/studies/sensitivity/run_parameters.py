"""The numbers of a mechanism by which a run is differentiated, by dotted names, and what makes mechanisms."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from numbers import Real
from threading import get_ident
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np

from ... import backend
from ...errors import InputError, StepError, UnknownNameError, is_number, require
from ...mechanism import Mechanism
from ...mechanism.callbacks import attempted
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.formats.loaded_model import LoadedModel, number
from ...mechanism.formats.template import Template
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import COINCIDENT
from ..sweep.sweep_run import Made, maker_of

_BOUND: WeakKeyDictionary[Mechanism, dict[Any, tuple[dict[str, float], Parameters]]] = WeakKeyDictionary()
"""The parameters by which a mechanism was differentiated last: workspaces of one thread."""

CHECKS = 9  # points of a run where differences are to hold

Names = Sequence[str] | Mapping[str, float]
Model = Any  # str | Path | Maker | Callable[..., Mechanism] | None


class MechanismFactory(Protocol):
    """Source of mechanisms with other parameters."""

    def make(self, values: Mapping[str, Any]) -> Mechanism:
        """The mechanism with these values."""


def mechanism_factory(mech: Mechanism | None, model: Model) -> MechanismFactory:
    """Return the source of mechanisms like one: its files, another file, or a function.

    Raises:
        InputError: where a mechanism was not read from files and no model is given.
    """
    if model is None and mech is not None:
        return LoadedModel(mech)
    return model if hasattr(model, "make") else maker_of(model)


def bound(sol: Solution, names: Names, model: Model) -> tuple[dict[str, float], Parameters]:
    """Return the values of parameters of a run, and their derivatives; reject what opens dependent rows at its start.

    Raises:
        UnknownNameError: for a name that leads nowhere.
        InputError: for a name without a number, a parameter without a derivative, or a force without direction there.
    """
    values, parameters = _last_or_new(sol, names, model)
    parameters.refuse_lost(float(sol.nodes[0][0]), sol.nodes[1][0][: sol.mechanism.nq])
    return values, parameters


def _last_or_new(sol: Solution, names: Names, model: Model) -> tuple[dict[str, float], Parameters]:
    mech, t, y = sol.mechanism, float(sol.nodes[0][0]), sol.nodes[1][0]
    if isinstance(names, Collection) and not isinstance(names, str) and not names:
        return {}, Parameters(lambda values: mech, {})
    key = get_ident(), t, float(sol.nodes[0][-1]), sol.mode(0), repr(names)
    if model is None and key in _BOUND.get(mech, {}):
        return _BOUND[mech][key]
    values, parameters = _bound(sol, names, mechanism_factory(mech, model))
    if isinstance(names, Mapping) or model is not None:
        _moves_alike(parameters.mech, sol)
    if parameters.mech.ng:
        parameters.require_consistent(t, y[: mech.nq])
    if model is None:
        _BOUND[mech] = {key: (values, parameters)}
    return values, parameters


def _bound(sol: Solution, names: Names, make: MechanismFactory) -> tuple[dict[str, float], Parameters]:
    values, mech, (ts, ys) = named_values(make, names), sol.mechanism, sol.nodes[:2]
    own = isinstance(make, Template) and not isinstance(names, Mapping)
    cuts = np.cumsum([mech.nq, mech.nv, len(mech.states)])
    some = np.linspace(0, len(ts) - 1, CHECKS).round().astype(int)
    along = [(float(ts[i]), q, v, s) for i in np.unique(some) for q, v, s, _ in [np.split(ys[i], cuts)]]
    parameters = Parameters(make.make, values, backend.load(), own=own, along=along, mode=sol.mode(0) or ())
    _compare(mech, parameters.mech)
    return values, parameters


def named_values(make: MechanismFactory, names: Names) -> dict[str, float]:
    """The parameters by name, with their values.

    Raises:
        UnknownNameError: for a name that leads nowhere.
        InputError: for what is no name, one that comes twice, or one without a number.
    """
    if isinstance(names, str) or not isinstance(names, Collection):
        raise InputError(f"parameters are a list of names, or name = value, got {names!r:.60}")
    for i, name in enumerate(listed := list(names)):
        if not isinstance(name, str):
            raise InputError(f"parameters have dotted names, as 'gravity.2' or 'joint.crank.mass', got {name!r:.60}")
        if name in listed[:i]:
            raise InputError(f"parameter {name!r} is named twice")
    if isinstance(names, Mapping):
        if isinstance(make, Made):
            make.check(names)
        return {name: _value(name, value) for name, value in names.items()}
    if not isinstance(make, Template):
        raise InputError("the parameters of a function that makes a mechanism are given as name = value")
    return {name: number(make, name) for name in listed}


def scaled(given: Any, usual: Mapping[str, float]) -> Array:
    """By which sizes parameters typically change, (k,): those that are given, and else the usual ones.

    Raises:
        UnknownNameError: for a name that is no parameter.
        InputError: for a size that is no positive number.
    """
    require(given if given is not None else {}, Mapping, "scales are a table, name = size")
    for name, x in (given or {}).items():
        if name not in usual:
            raise UnknownNameError("parameter", name, usual)
        if not (is_number(x) and x > 0):
            raise InputError(f"the scale of parameter {name!r} is a positive number, got {x!r:.60}")
    return np.array([float(x) for x in {**usual, **(given or {})}.values()])


def progress_reporter(progress: Any) -> Callable[[str], None]:
    """Return the function that reports progress to that of the user; without effect for None.

    Raises:
        InputError: for what is no function, and where it fails.
    """
    if progress is None:
        return lambda text: None
    if not callable(progress):
        raise InputError(f"progress is a function of a text, got {progress!r:.60}")
    return lambda text: attempted("progress", lambda: progress(text))


def reals(given: Any) -> list[float]:
    """The numbers of a list, which may be infinite; nothing where it is none."""
    listed = list(given) if isinstance(given, list | tuple | np.ndarray) else []
    fit = all(isinstance(x, Real) and not isinstance(x, bool) and not np.isnan(float(x)) for x in listed)
    return [float(x) for x in listed] if fit else []


def _value(name: str, value: Any) -> float:
    if not is_number(value):
        raise InputError(f"the value of parameter {name!r} is a finite number, got {value!r:.60}")
    return float(value)


def _compare(mech: Mechanism, other: Mechanism) -> None:
    """See that a mechanism that was made with the values is like the one that ran."""
    same = [(m.nq, m.nv, m.ng, list(m.states), m.joint_names) for m in (mech, other)]
    if same[0] != same[1]:
        raise InputError("the model makes another mechanism than the one that ran")


def _moves_alike(other: Mechanism, sol: Solution) -> None:
    """See that a mechanism moves like that of a run at its two ends, where it can be told."""
    for i in (0, -1):
        t, y = float(sol.nodes[0][i]), sol.nodes[1][i]
        with suppress(StepError):
            own, found = (m.system().derivative(t, y)[0] for m in (sol.mechanism, other))
            if np.abs(found - own).max() > COINCIDENT * (1 + np.abs(own).max()):
                raise InputError("with these values the model moves otherwise than the run: give its own")
