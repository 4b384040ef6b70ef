"""What a mechanism is given beside its model: start values, settings of the order study, motors."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ..errors import InputError
from ..system import Array
from .checked_table import Table
from .frames import find_joint

Value = float | tuple[float, ...]


class Start(Table):
    """The start state: q and v are held during assembly, guess and guess_v say where other coordinates start.

    Attributes:
        q: joint coordinates that assembly holds, in rad or m; the angle of a continuous joint, a list for several.
        v: joint velocities that assembly holds, in rad/s or m/s.
        guess: where assembly starts for other coordinates: it decides between branches, such as elbow up and down.
        guess_v: where assembly starts for other velocities.
        assemble: make the start consistent; else values are taken as they are, and refused where a closure is open.
    """

    q: dict[str, Value] = Field(default_factory=dict)
    v: dict[str, Value] = Field(default_factory=dict)
    guess: dict[str, Value] = Field(default_factory=dict)
    guess_v: dict[str, Value] = Field(default_factory=dict)
    assemble: bool = True

    @property
    def tables(self) -> dict[str, dict[str, Value]]:
        """The tables ``joint = value`` by name."""
        return {"q": self.q, "v": self.v, "guess": self.guess, "guess_v": self.guess_v}


class OrderSettings(Table):
    """The order study of the model, `mbdae.check_order`.

    Attributes:
        T: end time in s.
        steps: coarsest number of steps.
        q: held coordinates of a start of its own, instead of ``start``.
        v: held velocities of a start of its own, instead of ``start``.
    """

    T: float = Field(default=1.0, gt=0)
    steps: int = Field(default=20, ge=10)
    q: dict[str, Value] = Field(default_factory=dict)
    v: dict[str, Value] = Field(default_factory=dict)


class SolveSettings(Table):
    """Settings of runs of the model, as of `mbdae.solve`, which has them where it is given no others.

    A method that is given to a run stands without formulation, project and baumgarte of the file, a step without its
    tolerances, tolerances without its step.

    Attributes:
        method: a name of `mbdae methods`.
        formulation: ``"index2"``, ``"ggl"`` or ``"index1"``.
        project: bring the state back to the closures after each step.
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
    baumgarte: tuple[float, float] | None = None
    step: float | None = Field(default=None, gt=0)
    rtol: float | None = Field(default=None, gt=0)
    atol: float | None = Field(default=None, gt=0)
    first_step: float | None = Field(default=None, gt=0)
    max_step: float | None = Field(default=None, gt=0)
    max_steps: int | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _fit(self) -> "SolveSettings":
        if self.step is not None and (self.rtol, self.atol) != (None, None):
            raise ValueError("step is for steps of one size, rtol and atol for steps under control: not both")
        if self.baumgarte is not None and self.formulation != "index1":
            raise ValueError("baumgarte belongs to formulation 'index1'")
        return self

    @property
    def given(self) -> dict[str, Any]:
        """The settings that are said."""
        return {key: x for key in type(self).model_fields if (x := getattr(self, key)) is not None}


class Motor(NamedTuple):
    """A named input: control u gives gear u + b_0 + b_1 q + b_2 v on a joint of one coordinate, in N m or N."""

    name: str
    joint: str
    gear: float = 1.0
    bias: tuple[float, ...] = (0.0, 0.0, 0.0)


def coordinates(model: pin.Model, table: Mapping[str, Any], *, of_v: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the full vector that a table ``joint = value`` stands for, and the tangent indices it names.

    A list gives the values of a joint of several coordinates in Pinocchio's order; an unbounded revolute joint may
    be given by its angle.

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: for a wrong number of values, or a turn that vanishes.
    """
    out = np.zeros(model.nv) if of_v else pin.neutral(model)
    index: list[int] = []
    for name, value in table.items():
        j = find_joint(model, name)
        n, at = (j.nv, j.idx_v) if of_v else (j.nq, j.idx_q)
        try:
            values = np.atleast_1d(np.asarray(value, float))
        except (TypeError, ValueError):
            values = np.empty(0)
        if not of_v and (j.nq, j.nv) == (2, 1) and len(values) == 1:
            values = np.array([np.cos(values[0]), np.sin(values[0])])
        if values.shape != (n,) or not np.isfinite(values).all():
            raise InputError(
                f"joint {name!r} takes {n} finite {'velocity' if of_v else 'configuration'} values, got {value!r}"
            )
        out[at : at + n] = values
        if not of_v and normalized(model, out) is None:
            raise InputError(f"joint {name!r}: {value!r} is no turn: its quaternion, or cosine and sine, vanish")
        index += range(j.idx_v, j.idx_v + j.nv)
    return out if of_v else pin.normalize(model, out), np.array(index, int)


def normalized(model: pin.Model, q: np.ndarray) -> np.ndarray | None:
    """Return q (nq,) with quaternions, and cosines with sines, of length 1; None where one of them vanishes."""
    q = pin.normalize(model, q)
    return q if pin.isNormalized(model, q, 1e-8) else None


def vector(title: str, name: str, value: Any, n: int) -> Array:
    """Return a value of a mechanism as n finite numbers.

    Raises:
        InputError: if it is something else.
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
