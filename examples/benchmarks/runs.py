"""The result of a solver's run in work_precision.py, and the import of optional programs."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

Array = np.ndarray
SAMPLES = 20  # times at which |g| is measured for programs that provide no more


@dataclass(frozen=True)
class Run:
    """A run: seconds of the solver, angles relative to the parents at the end, largest |g| in m during the run."""

    seconds: float
    end: Array
    g: float


Runner = Callable[[float], Run | None]


def installed(name: str) -> ModuleType | None:
    """Import an optional program."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None
