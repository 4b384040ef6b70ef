"""mbdae: constrained mechanisms as index-2 DAEs, stepped by half-explicit Runge-Kutta methods and Radau IIA."""

from importlib import import_module
from typing import Any

from .cli import interrupt  # noqa: F401, before all that takes a second to import

# isort: split
from .errors import MbdaeError
from .integrate.events import Event
from .integrate.solve import solve
from .mechanism import (
    Actuator,
    Bushing,
    Closure,
    DCMotor,
    Driver,
    Function,
    JointDamping,
    JointFriction,
    JointPID,
    JointSpring,
    JointTorque,
    Mechanism,
    Sampled,
    SpringDamper,
    Wrench,
    load,
    model_names,
)
from .methods import METHODS
from .solution.solution import Solution
from .textbook.hessenberg import Hessenberg

_STUDIES = {  # loaded when used: plotting and viewing are slow to import
    "Random": "sweep.plan",
    "Sweep": "sweep.table",
    "animate": "replay.replay",
    "card": "card.card",
    "check_order": "order.order",
    "compare": "comparison.compare",
    "drift": "drift.drift",
    "report": "report.report",
    "sweep": "sweep.sweep",
}


def _replay(sol: Solution) -> str:
    return import_module(".studies.replay.replay", __name__).notebook(sol)


Solution.viewer = _replay  # solutions know nothing of studies: what shows them in notebooks is handed down


def __getattr__(name: str) -> Any:
    if name in _STUDIES:
        return getattr(import_module(f".studies.{_STUDIES[name]}", __name__), name)
    raise AttributeError(f"module 'mbdae' has no attribute {name!r}")


__all__ = [
    "METHODS",
    "Actuator",
    "Bushing",
    "Closure",
    "DCMotor",
    "Driver",
    "Event",
    "Function",
    "Hessenberg",
    "JointDamping",
    "JointFriction",
    "JointPID",
    "JointSpring",
    "JointTorque",
    "MbdaeError",
    "Mechanism",
    "Random",
    "Sampled",
    "Solution",
    "SpringDamper",
    "Sweep",
    "Wrench",
    "animate",
    "card",
    "check_order",
    "compare",
    "drift",
    "load",
    "model_names",
    "report",
    "solve",
    "sweep",
]
