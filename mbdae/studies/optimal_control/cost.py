"""Costs and constraints of controlled motions, with their derivatives with respect to the unknowns."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...callbacks import call_and_report, function_name
from ...errors import InputError, is_number
from ...system import Array
from ..sensitivity.cost import real
from .controlled_motion import ControlledMotion

Integrand = Callable[[Mapping[str, Array]], tuple[Array, Mapping[str, Array]]]
ValueAndGradient = tuple[float, Array]  # gradient with respect to the unknowns, (k,)


class SignalRequest(Mapping[str, Array]):
    """Placeholder signals, all ones, that record which signals an integrand uses."""

    def __init__(self) -> None:
        self.names = dict[str, None]()

    def __getitem__(self, name: str) -> Array:
        self.names[name] = None
        return np.ones(1)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


def integrand(cost: object) -> tuple[Integrand, list[str], str]:
    """Return an integrand as a function, the signals that it uses, and its name.

    Raises:
        InputError: for anything but a signal, weights of squares or a function.
    """
    if isinstance(cost, str):
        return (lambda x: (x[cost], {cost: np.ones_like(x[cost])})), [cost], cost
    if isinstance(cost, Mapping) and cost and all(isinstance(n, str) and is_number(w) for n, w in cost.items()):
        table = {name: float(w) for name, w in cost.items()}

        def squares(x: Mapping[str, Array]) -> tuple[Array, dict[str, Array]]:
            total = sum((w * x[name] ** 2 for name, w in table.items()), np.zeros(1))
            return total, {name: 2 * w * x[name] for name, w in table.items()}

        return squares, list(table), "the cost"
    if not callable(cost):
        raise InputError(
            f"a cost is a signal, {{signal: weight of its square}} or a function of signals, got {cost!r:.60}"
        )
    name, request = f"cost {function_name(cost)!r}", SignalRequest()
    call_and_report(name, lambda: cost(request), lambda: "one node, n = 1, with which it is called first")
    return cost, list(request), name


@dataclass(frozen=True)
class Integral:
    """The cost: the integral of L over the motion by Simpson's rule, plus a weight times its duration."""

    function: Integrand
    name: str
    time_weight: float

    def __call__(self, motion: ControlledMotion) -> ValueAndGradient:
        """Return the cost and its derivatives."""
        grid, length = motion.shooting.grid, motion.duration
        weights = np.tile(grid.weights(), grid.points - 1) * length / (grid.points - 1)
        L, partials = self._evaluated({name: x.ravel() for name, x in motion.values.items()}, len(weights))
        total, out = float(weights @ L), np.zeros(len(motion.z))
        for name, d in partials.items():
            out += (weights * d) @ motion.partials[name].reshape(len(d), -1)
        if grid.duration is None:
            out[-1] += total / length + self.time_weight
        return total + self.time_weight * length, out

    def _evaluated(self, signals: Mapping[str, Array], n: int) -> tuple[Array, dict[str, Array]]:
        """Return L (n,) and its derivatives with respect to signals, (n,) each, after checks.

        Raises:
            InputError: for an integrand that fails, is not finite, or has other shapes.
        """
        found = call_and_report(self.name, lambda: self.function(signals))
        try:
            values, table = found
            L, partials = real(values), {name: real(x) for name, x in table.items()}
        except (TypeError, ValueError, AttributeError):
            raise InputError(f"{self.name} returns (L, {{signal: dL}}), arrays (n,) each, got {found!r:.60}") from None
        if unused := [name for name in partials if name not in signals]:
            raise InputError(f"{self.name} has a derivative with respect to {unused[0]!r}, which it does not use")
        by_label = {"L": L} | {f"the derivative with respect to {name!r}": x for name, x in partials.items()}
        for label, x in by_label.items():
            if x.shape != (n,) or not np.isfinite(x).all():
                raise InputError(f"{self.name}: {label} must be {n} finite numbers, one for each node")
        return L, partials


@dataclass(frozen=True)
class SignalAtPoint:
    """A constraint: a signal at a point of the grid."""

    name: str
    point: int

    def __call__(self, motion: ControlledMotion) -> ValueAndGradient:
        """Return the signal and its derivatives."""
        last = motion.shooting.grid.points - 1
        index = (last - 1, -1) if self.point == last else (self.point, 0)
        return float(motion.values[self.name][index]), motion.partials[self.name][index]
