"""mbdae: constrained mechanisms as index-2 DAEs, stepped by half-explicit Runge-Kutta methods and Radau IIA."""

from importlib import import_module
from importlib.metadata import version
from typing import Any

from .cli import interrupt  # noqa: F401, before all that takes a second to import

# isort: split
from .errors import MbdaeError
from .integrate.events import Event
from .integrate.solve import solve
from .mechanism import (
    Closure,
    Clutch,
    Driver,
    Function,
    Mechanism,
    Stop,
    load,
    model_names,
)
from .mechanism.forces import NAMES as _FORCES
from .members import public
from .methods import METHODS, Tableau
from .solution.solution import Solution
from .textbook.hessenberg import Hessenberg

_STUDIES = public("mbdae.studies", "*/*.py")  # loaded when used: plotting and viewing are slow to import

globals().update(_FORCES)


def _study(name: str, function: str) -> Any:
    return getattr(import_module(f"mbdae.studies.{name}"), function)


# solutions and mechanisms know nothing of studies: what shows them is handed down, and loaded when used
Solution.viewer = lambda sol: _study("replay.replay", "notebook")(sol)  # type: ignore[assignment]
Solution.drawer = lambda sol, path, names: _study("figures", "given")(  # type: ignore[assignment]
    _study("run.figure", "motion")(sol, names), path
)
Mechanism.viewer = lambda mech: _study("card.card", "card")(mech)._repr_html_()  # type: ignore[assignment]
Mechanism.view = lambda mech, q=None: _study("view.view", "view")(mech, q)  # type: ignore[attr-defined]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("mbdae")
    if name in _STUDIES:
        return getattr(import_module(_STUDIES[name]), name)
    raise AttributeError(f"module 'mbdae' has no attribute {name!r}")


__all__ = [
    "METHODS",
    "Closure",
    "Clutch",
    "Driver",
    "Event",
    "Function",
    "Hessenberg",
    "MbdaeError",
    "Mechanism",
    "Solution",
    "Tableau",
    "Stop",
    "load",
    "model_names",
    "solve",
    *_FORCES,
    *_STUDIES,
]
