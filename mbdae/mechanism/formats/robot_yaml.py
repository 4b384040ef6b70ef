"""robot.urdf with robot.yaml: tables of parallel robots that supplement the URDF.

==============================  ========================================================================
closed_loop: [[frame, frame]]   pairs of frames that coincide
type: [6d]                      type of each pair: entire frames (6d, the default) or origins only (3d)
name_mot: [joint]               motors, of joints of one coordinate; a text selects all joints whose names contain it
joint_name: [joint]             joints that replace those of the URDF,
joint_type: [SPHERICAL]         and their kinds: SPHERICAL, UJOINT_XY (also CARDAN), UJOINT_XZ, ..., FIXED
==============================  ========================================================================

A universal joint replaces the URDF's joint and keeps its name; it has two coordinates.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import pinocchio as pin
from pydantic import BaseModel, ConfigDict, ValidationError

from ...discovery import lazy_import
from ...errors import InputError
from ...file_io import read_text
from ..allowed_paths import AllowedPaths
from ..checked_table import one_line
from ..closures.closure import Closure
from ..imported_model import ImportedModel
from ..model_settings import Motor
from ..tree.frames import find_joint, joint_names
from .body_tables import Source
from .reader import KEY, Reader
from .urdf.read import read_urdf

yaml_table = lazy_import("mbdae.mechanism.formats.yaml_table", "yaml_table")  # imports a reader of YAML
FILE, URDF = "robot.yaml", "robot.urdf"
CLOSURES: dict[str, Any] = {"6d": "frame", "3d": "point"}
KINDS = {
    "SPHERICAL": "spherical",
    "CARDAN": "universal_xy",
    **{f"UJOINT_{a}{b}": f"universal_{a}{b}".lower() for a, b in permutations("XYZ", 2)},
}
FIXED = "FIXED"


class RobotTables(BaseModel):
    """Valid entries of a robot.yaml; other keys are ignored and reported."""

    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)

    closed_loop: tuple[tuple[str, str], ...] = ()
    type: tuple[str, ...] | None = None
    name_mot: tuple[str, ...] | str = ()
    joint_name: tuple[str, ...] = ()
    joint_type: tuple[str, ...] = ()


def read_robot_yaml(path: Path, allowed: AllowedPaths, source: Source) -> ImportedModel:
    """Read a robot.yaml and the robot.urdf in the same folder.

    Args:
        path: path of the robot.yaml.
        allowed: allowed paths of meshes.
        source: options of the source: whether the root link has a free joint.

    Raises:
        InputError: for invalid contents; the message names the key and the expected value.
        UnknownNameError: for an unknown joint.
    """
    tables, urdf = read_tables(read_text(path), path.name), path.with_name(URDF)
    kinds = {n: t.upper() for n, t in zip(tables.joint_name, tables.joint_type, strict=True)}
    model_of_urdf = read_urdf(
        read_text(urdf),
        urdf.name,
        allowed,
        source.free_flyer,
        kinds={n: KINDS[t] for n, t in kinds.items() if t != FIXED},
        lock={n: 0.0 for n, t in kinds.items() if t == FIXED},
    )
    motors, unsupported = _actuated_joints(model_of_urdf.model, tables.name_mot, path.name)
    extra = sorted(tables.model_extra or ())
    unread = {f"keys of {path.name}": extra, "motors of joints of several coordinates": unsupported}
    return replace(
        model_of_urdf,
        closures=tuple(
            Closure(kind=CLOSURES[t.lower()], frames=pair)
            for pair, t in zip(tables.closed_loop, tables.type or (), strict=True)
        ),
        motors=tuple(Motor(n, n) for n in motors),
        left_out=(*model_of_urdf.left_out, *(f"{what} {', '.join(names)}" for what, names in unread.items() if names)),
    )


def _actuated_joints(model: pin.Model, motors: Sequence[str] | str, file: str) -> tuple[list[str], list[str]]:
    """Return the actuated joints with one, and with several, coordinates: listed, or matched by part of the name."""
    joints = joint_names(model)
    found = [n for n in joints if motors in n] if isinstance(motors, str) else motors
    if motors and not found:
        raise InputError(f"{file}: name_mot {motors!r} occurs in no joint's name: {', '.join(joints)}")
    single = {n: find_joint(model, n).nv == 1 for n in found}
    return [n for n in single if single[n]], [n for n in single if not single[n]]


def read_tables(text: str, name: str) -> RobotTables:
    """Read the tables of a robot.yaml.

    Raises:
        InputError: for invalid contents; the message names the key and the expected value.
    """
    content = yaml_table(text, name)
    if not isinstance(content, dict) or not any(k in RobotTables.model_fields for k in content):
        raise InputError(f"{name} is not a table of keys; known: {', '.join(RobotTables.model_fields)}")
    given = {str(k): v for k, v in content.items() if v is not None}
    try:
        tables = RobotTables.model_validate(given)
    except ValidationError as e:
        raise InputError(f"{name}: {one_line(e, lambda path: list(RobotTables.model_fields), given)}") from None
    if tables.type is None:
        tables = tables.model_copy(update={"type": ("6d",) * len(tables.closed_loop)})
    _require_same_length(name, "closed_loop", tables.closed_loop, "type", tables.type or ())
    _require_same_length(name, "joint_name", tables.joint_name, "joint_type", tables.joint_type)
    if duplicates := {n for n in tables.joint_name if tables.joint_name.count(n) > 1}:
        raise InputError(f"{name}: joint_name has {', '.join(sorted(duplicates))} more than once")
    for t in tables.type or ():
        _require_known(name, "type", t.lower(), CLOSURES)
    for t in tables.joint_type:
        _require_known(name, "joint_type", t.upper(), [*KINDS, FIXED])
    return tables


def _require_same_length(name: str, key: str, values: tuple[Any, ...], other: str, others: tuple[Any, ...]) -> None:
    if len(values) != len(others):
        raise InputError(f"{name}: {key} has {len(values)} entries, {other} has {len(others)}: one for each")


def _require_known(name: str, key: str, value: str, valid: Any) -> None:
    if value not in valid:
        raise InputError(f"{name}: {key} {value[:40]!r}; known: {', '.join(valid)}")


robot_yaml = Reader("robot.yaml", (".yaml",), read_robot_yaml, rejected=KEY)
