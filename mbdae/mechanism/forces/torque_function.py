"""Python functions tau(t, q, v) as forces."""

from collections.abc import Callable
from typing import Any

from ..callbacks import called, checked, function_name
from .force import Array, Law

TorqueFunction = Callable[[float, Array, Array], Array]


class TorqueLaw(Law):
    """A function tau(t, q, v) -> (nv,) of the user; its work is integrated."""

    def __init__(self, function: TorqueFunction) -> None:
        super().__init__(function_name(function))
        self.function = function

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        what = f"force {self.name!r}"
        return 0.0, checked(called(what, self.function, t, q, v), v.shape, t, what)

    def plain(self) -> dict[str, Any]:  # noqa: D102
        return {"kind": "python", "call": lambda *point: self.evaluate(*point)[1:]}
