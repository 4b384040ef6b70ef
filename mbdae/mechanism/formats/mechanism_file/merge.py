"""Merge the imported sources of a mechanism into the mechanism file."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

from ....errors import InputError, UnknownNameError
from ...forces.joint_friction import JointFriction
from ...forces.joint_torque import JointTorque
from ...forces.wrench import Wrench
from ...imported_model import FRICTION, LIMITS, ImportedModel, mimic_couplings
from ...model_settings import Motor, Start
from ...time_functions.time_functions import Constant
from ...tree.frames import joint_names
from .schema import MechanismFile


def merge_sources(
    file: MechanismFile, models: Sequence[ImportedModel]
) -> tuple[MechanismFile, tuple[Motor, ...], tuple[str, ...], tuple[str, ...]]:
    """Merge the contents of the sources into the mechanism file, which has priority.

    Returns:
        The file, the named inputs, the unsupported features of the sources, and the features that deserve a warning.

    Raises:
        UnknownNameError: for a motor that does not exist.
        InputError: for a locked mimic joint whose leader is not locked, or different gravities.
    """
    named = [m.prefixed(s.prefix) for s, m in zip(file.source, models, strict=True)]
    joints = [s.prefix + n for s, m in zip(file.source, models, strict=True) for n in joint_names(m.model)]
    couplings, lock = mimic_couplings(tuple(chain.from_iterable(m.mimics for m in named)), file.lock, joints)
    gravity = _gravity(file, named)
    motors = {x.name: x for x in chain.from_iterable(m.motors for m in named)}
    from_sources: dict[str, Iterable[Any]] = {
        "frame": chain.from_iterable(m.frames for m in named),
        "closure": (*chain.from_iterable(m.closures for m in named), *couplings),
        "driver": chain.from_iterable(m.drivers for m in named),
        "force": (*_forces(named, gravity), *_motor_torques(motors, _controls(file, named))),
    }
    update = {
        **{table: (*entries, *getattr(file, table)) for table, entries in from_sources.items()},
        "lock": lock,
        "gravity": gravity,
        "start": _start(file, named, {*lock, *file.joint_type}),
        "motor": {},
    }
    return file.model_copy(update=update), tuple(motors.values()), *_left_out(file, named)


def _start(file: MechanismFile, models: Sequence[ImportedModel], changed: Collection[str]) -> Start:
    """Return the start values of unchanged joints of the sources, overridden by start values of the file."""
    tables = {}
    for key, table in file.start.tables.items():
        old = {n: x for m in models for n, x in m.start.tables[key].items() if n not in changed}
        tables[key] = {**old, **table}
    return file.start.model_copy(update=tables)


def _forces(models: Sequence[ImportedModel], gravity: Sequence[float]) -> Iterator[Any]:
    for m in models:
        yield from m.forces
        yield from _weight_compensation(m.weightless, gravity)


def _controls(file: MechanismFile, models: Sequence[ImportedModel]) -> dict[str, Any]:
    return {**dict(chain.from_iterable(m.controls.items() for m in models)), **file.motor}


def _left_out(file: MechanismFile, models: Sequence[ImportedModel]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the features of the sources that are not carried over, and the features that deserve a warning."""
    used = {LIMITS: {s.joint for s in file.stop if s.limits}, FRICTION: set(_with_friction(file))}
    phrases = [(s, _without_used(text, used)) for s, m in zip(file.source, models, strict=True) for text in m.left_out]
    return tuple(x for _, x in phrases if x), tuple(x for s, x in phrases if x and not s.quiet)


def _with_friction(file: MechanismFile) -> Iterator[str | None]:
    """Yield the joints whose friction is used; None means all."""
    for force in file.force:
        if isinstance(force, JointFriction):
            yield from [force.joint] if isinstance(force.joint, str) else force.joint or [None]


def _without_used(text: str, used: Mapping[str, Collection[str | None]]) -> str:
    """Return a text of `_left_out` without joints that are used in stops or friction; None means all joints."""
    for what, joints in used.items():
        before, found, names = text.partition(f"{what} ")
        prefix = before.removesuffix(": ")
        if found and before in ("", f"{prefix}: "):
            remaining = [n for n in names.split(", ") if None not in joints and prefix + n not in joints]
            return before + found + ", ".join(remaining) if remaining else ""
    return text


def _motor_torques(motors: Mapping[str, Motor], controls: Mapping[str, object]) -> list[JointTorque]:
    for name in controls:
        if name not in motors:
            raise UnknownNameError("motor", name, motors)
    active = [m for m in motors.values() if m.name in controls or any(m.bias)]
    return [JointTorque(torque=controls.get(m.name, 0.0), **m._asdict()) for m in active]


def _gravity(file: MechanismFile, models: Sequence[ImportedModel]) -> tuple[float, ...]:
    given = list(dict.fromkeys(m.gravity for m in models if m.gravity))
    if "gravity" in file.model_fields_set or not given:
        return file.gravity
    if len(given) > 1:
        differing = " and ".join(str(list(g)) for g in given)
        raise InputError(f"sources have different gravity, {differing}: set it in the mechanism file")
    return given[0]


def _weight_compensation(weightless: Mapping[str, float], gravity: Sequence[float]) -> list[Wrench]:
    """Return forces that compensate the weight of weightless masses."""
    forces = {n: tuple(Constant(value=-mass * g) for g in gravity) for n, mass in weightless.items()}
    return [Wrench(name=n, frame=n, force=force) for n, force in forces.items() if any(gravity)]
