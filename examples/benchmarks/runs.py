"""What a run of a solver in work_precision.py returns, and how programs that may be missing are found."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

Array = np.ndarray
SAMPLES = 20  # times at which |g| is looked at where a program shows no more


@dataclass(frozen=True)
class Run:
    """A run: seconds of the solver, angles against the parents at the end, largest |g| in m on the way."""

    seconds: float
    end: Array
    g: float


Runner = Callable[[float], Run | None]


def installed(name: str) -> ModuleType | None:
    """Import a program that may be missing."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None
