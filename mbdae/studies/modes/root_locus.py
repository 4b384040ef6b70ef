"""Eigenvalues over a parameter or a speed: root loci and Campbell diagrams."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from ...arguments import as_numbers
from ...data_types import JsonObject
from ...errors import InputError, MbdaeError
from ...mechanism.equilibrium.spectrum import Spectrum
from ...mechanism.formats.mechanism_file.parameter_units import parameter_units
from ...mechanism.tree.coordinate_units import coordinate_units
from ...system import Array
from ...tabular import Columns, Tabular
from ...tolerances import ITERATION_ROUNDING, ROUNDING
from ...units import displayed, quantity
from ..factories import Model, factory_of, model_title, with_tables_loaded
from .modes import modes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["root_locus"]

SPEED_PREFIX = "v."
CROSSING_WIDTH = 1e-2  # half width of the search range of a crossing, as a fraction of an interval


@dataclass(frozen=True)
class RootLocus(Tabular):
    """Result of `root_locus`.

    Attributes:
        model: title or name of the model.
        name: name of the parameter.
        values: values of the parameter, (n,).
        eigenvalues: eigenvalues tracked over the values, (n, m); nan where they could not be computed.
        messages: reasons for missing eigenvalues, by index of the value.
        changes: values at which the number of growing modes changes.
        unit: unit of the parameter; "" if unknown.
    """

    model: str
    name: str
    values: Array
    eigenvalues: Array
    messages: dict[int, str]
    changes: tuple[float, ...]
    unit: str = ""

    def plot(self, path: str | Path | None = None, *, campbell: bool | None = None) -> "Figure":
        """Draw real parts and frequencies against the parameter, and the roots in the complex plane; optionally saved.

        Args:
            path: file to write.
            campbell: draw lines at integer multiples of the speed among the frequencies; for speeds when left out.

        Raises:
            InputError: for another format, or an unwritable path.
        """
        from .. import figures
        from .figure import locus

        lines = self.name.startswith(SPEED_PREFIX) if campbell is None else campbell
        return figures.save_if_path(locus(self, lines), path)

    def to_columns(self) -> Columns:
        """Return real and imaginary parts over the parameter."""
        parts = {"re": self.eigenvalues.real, "im": self.eigenvalues.imag}
        columns = {f"{part}.{k + 1}": x[:, k] for k in range(self.eigenvalues.shape[1]) for part, x in parts.items()}
        units = {self.name: self.unit} if self.unit else {}
        return Columns({self.name: self.values, **columns}, units | dict.fromkeys(columns, "1/s"), self.name)

    def to_dict(self) -> JsonObject:
        """Return JSON data; eigenvalues as pairs [re, im]."""
        pairs = [[[z.real, z.imag] for z in row] for row in self.eigenvalues.tolist()]
        return {
            "model": self.model,
            "parameter": self.name,
            "values": self.values.tolist(),
            "eigenvalues": pairs,
            "changes": list(self.changes),
            "messages": self.messages,
        }

    def __str__(self) -> str:
        n, m = self.eigenvalues.shape
        span = f"{displayed(self.values[0], self.unit)[0]:g} to {quantity(self.values[-1], self.unit, 'g')}"
        lines = [f"root locus of {self.model} over {self.name}, {span}: {n} values, {m} eigenvalues"]
        growth = np.nanmax(self.eigenvalues.real, axis=1) if m else np.zeros(n)
        least, most = displayed(growth.min(), "1/s")[0], quantity(growth.max(), "1/s")
        lines.append(f"  largest real part {least:.6g} to {most}")
        changes = [quantity(x, self.unit, ".9g") for x in self.changes]
        lines += [f"  the number of growing modes changes at {self.name} = {x}" for x in changes]
        lines += [f"  {self.name} = {quantity(self.values[i], self.unit, 'g')}: {x}" for i, x in self.messages.items()]
        return "\n".join(lines)


def root_locus(
    model: Model,
    name: str,
    values: Sequence[float] | Array,
    *,
    v: Mapping[str, float] | None = None,
    start: Mapping[str, Any] | None = None,
    **options: Any,
) -> RootLocus:
    """Track eigenvalues over a parameter or a speed.

    Args:
        model: a mechanism that was loaded, an argument of `mbdae.load`, or a function of the parameter.
        name: a parameter as in `mbdae.sweep`: ``"force.spring.stiffness"``, ``"start.v.shaft"``, ``"speed"`` of a
            mechanism.py; or ``"v.shaft"``, a constant speed of a joint.
        values: values of the parameter, in order.
        v: further constant speeds, see `mbdae.modes`.
        start: further parameters, constant: ``{"start.q.crank": 0.3}``.
        options: q, t and hold of `mbdae.modes`.

    Returns:
        The eigenvalues, each tracked over the parameter.

    Raises:
        UnknownNameError, InputError: for an unknown model or parameter, or if no value has modes.
    """
    numbers = as_numbers(values)
    if numbers.ndim != 1 or not len(numbers) or not np.isfinite(numbers).all():
        raise InputError(f"a root locus takes a list of numbers, got {values!r:.60}")
    model = with_tables_loaded(model)
    roots = _roots(model, name, float(numbers[0]), v or {}, dict(start or {}), options)
    rows: list[Spectrum | None] = []
    messages: dict[int, str] = {}
    for i, value in enumerate(numbers.tolist()):
        try:
            rows.append(roots(value))
        except MbdaeError as e:
            rows.append(None)
            messages[i] = str(e)
    if len(messages) == len(rows):
        raise InputError(f"no value of {name} has modes: {messages[0]}")
    eigenvalues = _branches(rows)
    found = [None if np.isnan(z).any() else row for z, row in zip(eigenvalues, rows, strict=True)]
    changed = np.flatnonzero([_differ(a, b) for a, b in pairwise(found)])
    changes = [_change(roots, *numbers[i : i + 2].tolist()) for i in changed]
    title, unit = model_title(model), _unit(model, name, start or {})
    return RootLocus(title, name, numbers, eigenvalues, messages, tuple(changes), unit)


def _unit(model: Model, name: str, start: Mapping[str, Any]) -> str:
    """Return the unit of a parameter or a speed; "" if unknown."""
    factory = factory_of(model)
    if name.startswith(SPEED_PREFIX):
        return coordinate_units(factory.make(dict(start))).get(name, "")
    return parameter_units(factory, [name]).get(name, "")


def _roots(
    model: Model, name: str, first: float, v: Mapping[str, float], start: dict[str, Any], options: dict[str, Any]
) -> Callable[[float], Spectrum]:
    """Return the spectrum as a function of a parameter or a constant speed; ``first`` is one of its values.

    Raises:
        UnknownNameError, InputError: for a model or parameter that does not exist.
    """
    factory = factory_of(model)
    if name.startswith(SPEED_PREFIX) and name != SPEED_PREFIX:
        joint, checked = name.removeprefix(SPEED_PREFIX), start
    else:
        joint, checked = "", {**start, name: first}
    factory.check({n: x for n, x in checked.items() if n not in factory.parameters})

    def roots(value: float) -> Spectrum:
        if joint:
            return modes(factory.make(start), v={**v, joint: value}, **options).spectrum
        return modes(factory.make({**start, name: value}), v=v or None, **options).spectrum

    return roots


def _branches(rows: Sequence[Spectrum | None]) -> Array:
    """Return eigenvalues tracked over the values, (n, m); nan where they are unknown, or fewer than the maximum."""
    size = max(len(row.values) for row in rows if row is not None)
    out = np.full((len(rows), size), np.nan + 0j)
    last: Array | None = None
    for i, row in enumerate(rows):
        if row is not None and len(row.values) == size:
            last = out[i] = row.values if last is None else row.values[_matching_order(last, row.values)]
    return out


def _differ(a: Spectrum | None, b: Spectrum | None) -> bool:
    """Return whether the number of growing modes differs; False if a spectrum is unknown."""
    return a is not None and b is not None and bool(a.growing.sum() != b.growing.sum())


def _change(roots: Callable[[float], Spectrum], low: float, high: float) -> float:
    """Return the value at which the number of growing eigenvalues changes, by bisection or root finding."""
    before, half_width = roots(low).growing.sum(), CROSSING_WIDTH * (high - low)
    crossed = None
    while abs(high - low) > ITERATION_ROUNDING * max(abs(low), abs(high)):
        if crossed is None and abs(high - low) < abs(half_width):
            crossed = _crossing(roots, (low + high) / 2, half_width)
            if not np.isnan(crossed):
                return crossed
        middle = (low + high) / 2
        try:
            same = roots(middle).growing.sum() == before
        except MbdaeError:
            break
        low, high = (middle, high) if same else (low, middle)
    return (low + high) / 2


def _crossing(roots: Callable[[float], Spectrum], value: float, half_width: float) -> float:
    """Return the value at which a root crosses the imaginary axis; nan if it does not change sides."""

    def growth(x: float) -> float:
        found = roots(x).values
        return float(found[np.abs(found - root).argmin()].real)

    try:
        a, b = roots(value - half_width), roots(value + half_width)
        matched = b.sorted(_matching_order(a.values, b.values))
        crossing = np.flatnonzero(a.known & matched.known & (a.values.real * matched.values.real < 0))
        if not len(crossing):
            return np.nan
        root = (a.values + matched.values)[crossing[0]] / 2
        ends = growth(value - half_width), growth(value + half_width)
        tolerance = ROUNDING * max(abs(value), abs(half_width))
        if ends[0] * ends[1] >= 0:
            return np.nan
        return float(brentq(growth, value - half_width, value + half_width, xtol=tolerance))
    except MbdaeError:
        return np.nan


def _matching_order(before: Array, after: Array) -> Array:
    """Return the permutation of eigenvalues with the smallest total distance to the previous ones."""
    return linear_sum_assignment(np.abs(before[:, None] - after))[1]


def read_range(text: str) -> tuple[str, Array]:
    """Read ``name=first:last:number``.

    Raises:
        InputError: for anything else.
    """
    name, _, rest = text.partition("=")
    try:
        first, last, n = rest.split(":")
        return name, np.linspace(float(first), float(last), int(n))
    except ValueError:
        raise InputError(f"the range is name=first:last:number, got {text!r}") from None
