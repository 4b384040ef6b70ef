"""Costs of runs: functions of signals with their derivatives."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arguments import is_real
from ...callbacks import call_and_report, function_name
from ...errors import InputError, is_number
from ...solution.signals import signals, units
from ...solution.solution import Solution
from ...system import Array

__all__ = ["Squares"]


class Signals(Mapping[str, Array]):
    """The signals of a run by name, each computed when first used."""

    def __init__(self, sol: Solution) -> None:
        self.sol, self.computed = sol, {}  # type: Solution, dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        if name not in self.computed:
            self.computed |= signals(self.sol, [name])
        return self.computed[name]

    def __iter__(self) -> Iterator[str]:
        return iter(units(self.sol.mechanism))

    def __len__(self) -> int:
        return len(list(iter(self)))


Cost = Callable[[Mapping[str, Array]], tuple[float, Mapping[str, Array]]]


class NamedCost:
    """A function of signals with a name for messages.

    Attributes:
        label: its name, for instance ``"constraint 'reach'"``.
    """

    label: str


@dataclass(frozen=True)
class Squares:
    """The cost 1/2 sum ((signal - data)/sigma)^2 over signals and times of a run.

    Attributes:
        data: for each signal its values at the times of the run, (n,); nan for missing values.
        sigma: noise level of all signals, or of each by name, in their units.
    """

    data: Mapping[str, Any]
    sigma: float | Mapping[str, float] = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.data, Mapping) or not self.data:
            raise InputError(f"Squares takes data, {{signal: its values (n,)}}, got {self.data!r:.60}")
        for name, data in self.data.items():
            level = self._sigma(name)
            if not (is_number(level) and level > 0):
                raise InputError(f"the noise level of {name!r} must be a positive number, got {level!r:.60}")
            if not np.isfinite(_numbers(name, data)).any():
                raise InputError(f"data of {name!r} have no number")

    def __call__(self, signals: Mapping[str, Array]) -> tuple[float, dict[str, Array]]:
        """Return the cost and its derivatives with respect to the signals."""
        value, derivatives = 0.0, {}
        for name, data in self.data.items():
            sigma = self._sigma(name)
            data = _numbers(name, data)
            if data.shape != signals[name].shape:
                raise InputError(f"data of {name!r} have shape {data.shape}, the run has {signals[name].shape} times")
            residual = np.where(np.isnan(data), 0.0, signals[name] - data) / sigma
            value, derivatives[name] = value + 0.5 * float(residual @ residual), residual / sigma
        return value, derivatives

    def _sigma(self, name: str) -> float:
        if not isinstance(self.sigma, Mapping):
            return self.sigma
        if name not in self.sigma:
            raise InputError(f"data of {name!r} have no noise level: sigma has {', '.join(self.sigma)}")
        return self.sigma[name]


def _numbers(name: str, data: object) -> Array:
    try:
        return real(data)
    except (TypeError, ValueError):
        raise InputError(f"data of {name!r} are numbers, got {data!r:.60}") from None


def real(x: object) -> Array:
    """Return real numbers as an array.

    Raises:
        TypeError, ValueError: for anything else.
    """
    found = np.asarray(x)
    if not is_real(found):
        raise TypeError(f"expected real numbers, got {found.dtype}")
    return found.astype(float)


def cost_name(cost: object) -> str:
    """Return the name of a cost in messages."""
    return cost.label if isinstance(cost, NamedCost) else f"cost {function_name(cost)!r}"


def evaluated(cost: Cost, signals: Mapping[str, Array], n: int) -> tuple[float, dict[str, Array]]:
    """Return a cost of signals (n,) and its derivatives, after checks.

    Raises:
        InputError: for a cost that fails or is not finite, or derivatives of the wrong shape.
    """
    if not callable(cost):
        raise InputError(f"a cost is a function of signals that returns (value, derivatives), got {cost!r:.60}")
    found = call_and_report(label := cost_name(cost), lambda: cost(signals))
    try:
        cost_value, table = found
        value, derivatives = float(real(cost_value)), {key: real(x) for key, x in table.items()}
        if cost_value is None or isinstance(cost_value, str | bool | np.bool_):
            raise TypeError
    except (TypeError, ValueError, AttributeError):
        expected = f"{label} returns (value, {{signal: its derivative (n,)}})"
        raise InputError(f"{expected}, got {found!r:.60}") from None
    if not np.isfinite(value):
        raise InputError(f"{label} is {value}")
    for key, x in derivatives.items():
        if x.shape != (n,) or not np.isfinite(x).all():
            raise InputError(f"{label}: its derivative with respect to {key!r} must be {n} finite numbers")
    return value, derivatives
