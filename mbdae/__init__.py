"""mbdae: constrained mechanisms as index-2 DAEs, stepped by half-explicit Runge-Kutta methods and Radau IIA."""

from importlib import import_module
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
from .methods import METHODS
from .solution.solution import Solution
from .textbook.hessenberg import Hessenberg

_STUDIES = public("mbdae.studies", "*/*.py")  # loaded when used: plotting and viewing are slow to import

globals().update(_FORCES)


def _replay(sol: Solution) -> str:
    return import_module(_STUDIES["animate"]).notebook(sol)


Solution.viewer = _replay  # solutions know nothing of studies: what shows them in notebooks is handed down


def __getattr__(name: str) -> Any:
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
    "Stop",
    "load",
    "model_names",
    "solve",
    *_FORCES,
    *_STUDIES,
]
