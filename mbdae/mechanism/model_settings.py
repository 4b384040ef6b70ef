"""Settings of a mechanism besides its model: start values, settings of the order study, motors."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ..arguments import as_numbers
from ..errors import InputError, require
from ..system import Array
from ..tolerances import HALF_DIGITS
from .checked_table import Table
from .key_units import Coordinates, Unit
from .tree.coordinate_units import model_suffixes
from .tree.frames import find_joint

Value = float | tuple[float, ...]
T = TypeVar("T", bound=Table)


class Start(Table):
    """Start state: q and v are fixed during assembly, guess and guess_v are initial estimates of other coordinates.

    Attributes:
        q: joint coordinates that are fixed during assembly, in rad or m; the angle of a continuous joint, a list for
            several coordinates.
        v: joint velocities that are fixed during assembly, in rad/s or m/s.
        guess: initial estimates of other coordinates: they select the assembly branch, such as elbow up or down.
        guess_v: initial estimates of other velocities, 0 if omitted; they are projected, in the mass metric, onto the
            closures and drivers: a joint on a driven body then moves, too, unless ``v`` fixes it.
        assemble: make the start consistent; if false, values are used as given, and rejected if they violate a closure.
    """

    q: Annotated[dict[str, Value], Coordinates()] = Field(default_factory=dict)
    v: Annotated[dict[str, Value], Coordinates(per_time=True)] = Field(default_factory=dict)
    guess: Annotated[dict[str, Value], Coordinates()] = Field(default_factory=dict)
    guess_v: Annotated[dict[str, Value], Coordinates(per_time=True)] = Field(default_factory=dict)
    assemble: bool = True

    @property
    def tables(self) -> dict[str, dict[str, Value]]:
        """Tables ``joint = value`` by name."""
        return {"q": self.q, "v": self.v, "guess": self.guess, "guess_v": self.guess_v}


class OrderSettings(Table):
    """Settings of the order study of the model, `mbdae.order`.

    Attributes:
        T: end time in s.
        steps: smallest number of steps.
        q: fixed coordinates of a separate start, instead of ``start``.
        v: fixed velocities of a separate start, instead of ``start``.
    """

    T: Annotated[float, Unit("s")] = Field(default=1.0, gt=0)
    steps: int = Field(default=20, ge=10)
    q: Annotated[dict[str, Value], Coordinates()] = Field(default_factory=dict)
    v: Annotated[dict[str, Value], Coordinates(per_time=True)] = Field(default_factory=dict)


CONTROL_SETTINGS = "rtol", "atol", "first_step", "max_step"  # settings of step-size control


class SolveSettings(Table):
    """Default settings of `mbdae.solve` for the model.

    If a run is given a method, formulation, project and baumgarte of the file do not apply; if it is given a step,
    tolerances and limits of steps of the file do not apply, and vice versa.

    Attributes:
        method: a name of `mbdae methods`.
        formulation: ``"index2"``, ``"ggl"`` or ``"index1"``.
        project: project the state onto the closures after each step.
        baumgarte: alpha and beta in 1/s, for index1.
        step: fixed step in s, instead of tolerances.
        rtol: relative tolerance.
        atol: absolute tolerance.
        first_step: first step in s.
        max_step: largest step in s.
        max_steps: largest number of steps.
    """

    method: str | None = None
    formulation: Literal["index2", "ggl", "index1"] | None = None
    project: bool | None = None
    baumgarte: Annotated[tuple[float, float] | None, Unit("1/s")] = None
    step: Annotated[float | None, Unit("s")] = Field(default=None, gt=0)
    rtol: Annotated[float | None, Unit("1")] = Field(default=None, gt=0)
    atol: Annotated[float | None, Unit("1")] = Field(default=None, gt=0)
    first_step: Annotated[float | None, Unit("s")] = Field(default=None, gt=0)
    max_step: Annotated[float | None, Unit("s")] = Field(default=None, gt=0)
    max_steps: int | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _require_compatible(self) -> "SolveSettings":
        if self.step is not None and any(getattr(self, name) is not None for name in CONTROL_SETTINGS):
            raise ValueError(f"step sets fixed steps, {', '.join(CONTROL_SETTINGS)} step-size control: give either")
        if self.baumgarte is not None and self.formulation != "index1":
            raise ValueError("baumgarte belongs to formulation 'index1'")
        return self

    @property
    def given(self) -> dict[str, Any]:
        """Settings that are not None."""
        return {key: x for key, x in vars(self).items() if x is not None}


class Motor(NamedTuple):
    """Named input: a control u applies gear u + b_0 + b_1 q + b_2 v, in N m or N, to a joint of one coordinate."""

    name: str
    joint: str
    gear: float = 1.0
    bias: tuple[float, ...] = (0.0, 0.0, 0.0)


def coordinates(model: pin.Model, table: Mapping[str, object], *, of_v: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the full vector of a table ``joint = value``, and the tangent indices of the joints that it names.

    A list gives the values of a joint of several coordinates in Pinocchio's order; an unbounded revolute joint may
    be given by its angle.

    Raises:
        UnknownNameError: for an unknown joint.
        InputError: for a wrong number of values, or a zero quaternion or direction.
    """
    out = np.zeros(model.nv) if of_v else pin.neutral(model)
    for name, value in table.items():
        j = find_joint(model, name)
        n, first = (j.nv, j.idx_v) if of_v else (j.nq, j.idx_q)
        values = np.atleast_1d(as_numbers(value))
        if not of_v and (j.nq, j.nv) == (2, 1) and len(values) == 1:
            values = np.array([np.cos(values[0]), np.sin(values[0])])
        if values.shape != (n,) or not np.isfinite(values).all():
            raise InputError(f"joint {name!r} takes {_expected_values(model, name, of_v)}, got {value!r}")
        out[first : first + n] = values
        if not of_v and normalized_or_none(model, out) is None:
            raise InputError(f"joint {name!r}: {value!r} is not a rotation: its quaternion, or cosine and sine, vanish")
    return out if of_v else pin.normalize(model, out), tangent_indices(model, table)


def _expected_values(model: pin.Model, name: str, of_v: bool) -> str:
    """Return how many values a joint takes, and the names of several."""
    joint, names = find_joint(model, name), [suffix[1:] for suffix in model_suffixes(model, name)[of_v]]
    if (joint.nq, joint.nv) == (2, 1) and not of_v:
        return "1 finite configuration value (its angle), or 2 (cosine and sine)"
    text = f"{len(names)} finite {'velocity' if of_v else 'configuration'} value{'s' * (len(names) > 1)}"
    return f"{text} ({', '.join(names)})" if len(names) > 1 else text


def tangent_indices(model: pin.Model, names: Iterable[str]) -> np.ndarray:
    """Return the indices in v of the coordinates of joints, (n,)."""
    joints = [find_joint(model, name) for name in names]
    return np.array([i for j in joints for i in range(j.idx_v, j.idx_v + j.nv)], int)


def normalized_or_none(model: pin.Model, q: np.ndarray) -> np.ndarray | None:
    """Return q (nq,) with quaternions, and (cos, sin) pairs, normalized; None if one of them is zero."""
    q = pin.normalize(model, q)
    return q if pin.isNormalized(model, q, HALF_DIGITS) else None


def as_table(kind: type[T], value: Any) -> T:
    """Return an argument, given as a table or by its values, as a table; an empty table for None.

    Raises:
        InputError: for any other value, or invalid values.
    """
    if isinstance(value, kind):
        return value
    require(value, Mapping | None, f"expected {kind.__name__}, or a table of its values")
    return kind(**value or {})


def vector(title: str, name: str, value: object, n: int) -> Array:
    """Return a value of a mechanism as n finite numbers.

    Raises:
        InputError: for any other value.
    """
    try:
        x = np.asarray(value, float)
    except (TypeError, ValueError):
        text = f"{name} is an array of {n} numbers, got {value!r}; assemble() takes values by name"
        raise InputError(text) from None
    if x.shape != (n,):
        raise InputError(f"{name} has shape {x.shape}, expected ({n},) for {title!r}")
    if not np.isfinite(x).all():
        raise InputError(f"{name} is not finite: {x}")
    return x
