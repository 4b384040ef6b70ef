"""Imported model: the joint tree of one source file, with its closures, forces and settings."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin
from pydantic import BaseModel

from ..errors import InputError
from .closures.closure import Axis, Closure
from .closures.driver import Driver
from .model_settings import Motor, Start
from .tree.frames import WORLD

LISTED_NAMES = 4  # before "and n more"
LIMITS, FRICTION = "limits of joints", "friction of joints"  # as named in `ImportedModel.left_out`
EFFORTS, MIMICRY = "limits of effort and velocity of joints", "mimic constraints without a moving leader on"
T = TypeVar("T", bound=BaseModel)


class Mimic(NamedTuple):
    """A joint that follows another: q_joint = multiplier * q_other + offset."""

    joint: str
    other: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class ImportedModel:
    """Contents of one source file.

    Attributes:
        model: the joint tree.
        visuals: visual geometry of the tree.
        record: returns JSON data from which the tree and its visuals can be recreated.
        gravity: gravity in m/s^2, if the file defines it.
        closures: closures of the file.
        drivers: drivers of the file.
        mimics: joints that follow others.
        forces: descriptions of the forces of the file.
        frames: tables of frames used by the closures.
        weightless: masses in kg on which gravity does not act, by frame at the centre of mass.
        start: start state of the file.
        motors: named inputs of the file.
        controls: values of inputs given by the file.
        normals: normals of the planes of planar joints, in their frames.
        left_out: features of the file that are not supported.
    """

    model: pin.Model
    visuals: pin.GeometryModel | None
    record: Callable[[], dict[str, Any]]
    gravity: tuple[float, ...] | None = None
    closures: tuple[Closure, ...] = ()
    drivers: tuple[Driver, ...] = ()
    mimics: tuple[Mimic, ...] = ()
    forces: tuple[Any, ...] = ()
    weightless: Mapping[str, float] = field(default_factory=dict)
    frames: tuple[Any, ...] = ()
    start: Start = field(default_factory=Start)
    motors: tuple[Motor, ...] = ()
    controls: Mapping[str, float] = field(default_factory=dict)
    normals: Mapping[str, Axis] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    def prefixed(self, prefix: str) -> "ImportedModel":
        """Return the model with a prefix on every name outside the tree, as `Tree.graft` does inside it."""
        if not prefix:
            return self
        names = {key: {prefix + n: x for n, x in table.items()} for key, table in self.start.tables.items()}
        return replace(
            self,
            closures=tuple(prefixed(c, prefix) for c in self.closures),
            drivers=tuple(prefixed(d, prefix) for d in self.drivers),
            forces=tuple(prefixed(f, prefix) for f in self.forces),
            frames=tuple(prefixed(f, prefix) for f in self.frames),
            weightless={prefix + n: mass for n, mass in self.weightless.items()},
            mimics=tuple(Mimic(prefix + m.joint, prefix + m.other, *m[2:]) for m in self.mimics),
            start=self.start.model_copy(update=names),
            motors=tuple(Motor(prefix + m.name, prefix + m.joint, *m[2:]) for m in self.motors),
            controls={prefix + n: u for n, u in self.controls.items()},
            left_out=tuple(f"{prefix}: {text}" for text in self.left_out),
        )


def prefixed(table: T, prefix: str) -> T:
    """Return a closure, driver or force with a prefix on its name and on those of its joints and frames."""

    def renamed(value: object) -> Any:
        if isinstance(value, str):
            return value if value in ("", WORLD) else prefix + value
        return tuple(renamed(v) for v in value) if isinstance(value, tuple) else value

    keys = ("name", "joint", "joints", "frame", "frames", "parent")
    return table.model_copy(update={k: renamed(getattr(table, k)) for k in keys if getattr(table, k, None)})


def mimic_couplings(
    mimics: tuple[Mimic, ...], locked: dict[str, Any], joints: list[str]
) -> tuple[list[Closure], dict[str, Any]]:
    """Return couplings for mimic joints, and the locked joints; followers of locked joints are locked, too.

    Args:
        mimics: the joints that follow others.
        locked: joint = value.
        joints: names of the moving joints.

    Raises:
        InputError: if a joint is locked, but the joint it follows is not.
    """
    locked, remaining = dict(locked), [m for m in mimics if m.joint in joints]
    while resolved := [m for m in remaining if m.other in locked]:
        for m in resolved:
            if m.joint not in locked:
                locked[m.joint] = m.multiplier * float(np.squeeze(locked[m.other])) + m.offset
        remaining = [m for m in remaining if m not in resolved]
    for m in remaining:
        if m.joint in locked:
            raise InputError(f"joint {m.joint!r} follows {m.other!r} and cannot be locked alone: lock {m.other!r}")
    return [
        Closure.coupling(m.joint, m.other, (m.offset, m.multiplier), f"{m.joint} follows {m.other}") for m in remaining
    ], locked


def name_list(what: str, names: Iterable[str]) -> str:
    """Return a phrase that consists of a description and all names."""
    return f"{what} {', '.join(names)}".strip()


def short_name_list(phrase: str) -> str:
    """Return a phrase of `name_list` with its first names only: ``mbdae info`` prints all."""
    names = phrase.split(", ")
    more = len(names) - LISTED_NAMES
    return f"{', '.join(names[:LISTED_NAMES])} and {more} more (see mbdae info)" if more > 0 else phrase


def not_carried_over(name: str, phrases: Iterable[str]) -> str:
    """Return the warning that names features of files that a mechanism does not support."""
    return f"{name}: not carried over: {'; '.join(map(short_name_list, phrases))}"
