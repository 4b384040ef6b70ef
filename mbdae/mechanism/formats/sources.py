"""The source files of a mechanism: read, remembered, and merged with what the mechanism file says."""

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import InputError, UnknownNameError
from ...file_io import text_of
from ..allowed_paths import AllowedPaths
from ..forces.joint_friction import JointFriction
from ..forces.joint_torque import JointTorque
from ..forces.wrench import Wrench
from ..frames import joint_names
from ..imported_model import FRICTION, LIMITS, ImportedModel, mimic_couplings
from ..model_serialization import model_from_data
from ..model_settings import Motor
from ..scene.shapes import unpack
from ..time_functions import Constant
from .loop_closures import with_loops
from .mjcf.read import read_mjcf
from .model_library import SOURCES, installed, resolve
from .robot_yaml import read_robot_yaml
from .schema import MechanismFile, Source
from .sdf.read import SdfRecord, read_sdf
from .urdf import Record, read_urdf


def read_source(source: Source, base: Path) -> ImportedModel:
    """Read a source file, relative to ``base``.

    Raises:
        InputError: for a file that is missing, wrong, or of a kind that is not read.
    """
    path = resolve(source.file, base)
    if path.suffix not in SOURCES:
        raise InputError(f"cannot read source {path.name}: expected {', '.join(SOURCES)}")
    places = AllowedPaths.of(path, [base, *(base / p for p in source.packages)])
    if path.suffix in (".xml", ".mjcf") and not _is_urdf(path):
        if source.free_flyer:
            raise InputError(f"free_flyer does not belong to an MJCF source: {path.name} has free joints of its own")
        return read_mjcf(path, places, source.key)
    if source.key:
        raise InputError(f"key belongs to an MJCF source, not to {path.name}")
    if path.suffix == ".sdf":
        if source.free_flyer:
            raise InputError(f"free_flyer does not belong to an SDF source: free links of {path.name} fly anyway")
        return read_sdf(text_of(path), path.name, places)
    if path.suffix == ".yaml":
        return read_robot_yaml(path, places, source.free_flyer)
    return with_loops(read_urdf(text_of(path), path.name, places, source.free_flyer), path, places)


def restored(record: Mapping[str, Any], meshes: Sequence[Path] | None = None) -> ImportedModel:
    """Make the part again that remembers itself as ``record``, as far as its tree and visuals go.

    Args:
        record: what a part said of itself.
        meshes: folders from which a saved run may read meshes, beside installed packages; None for parts of this
            process, which read them where they did.

    Raises:
        InputError: for a record that is damaged.
    """
    if "urdf" in record:
        r = Record.model_validate(record)
        folders = tuple(map(Path, r.packages))
        places = AllowedPaths(Path(r.folder), folders)
        if meshes is not None:
            asked = tuple(p.resolve() for p in meshes)
            places = AllowedPaths(Path(r.folder), (*folders, *asked), (*asked, *installed()))
        return read_urdf(r.urdf, "URDF", places, r.free_flyer, kinds=r.kinds, lock=r.lock)
    if "sdf" in record:
        of = SdfRecord.model_validate(record)
        return read_sdf(of.sdf, "SDF", AllowedPaths(Path(of.folder), tuple(map(Path, of.packages))))
    model = model_from_data(record["model"])
    return ImportedModel(model, unpack(record["visuals"], model.njoints), dict(record).copy)


def merged(
    file: MechanismFile, parts: Sequence[ImportedModel]
) -> tuple[MechanismFile, tuple[Motor, ...], tuple[str, ...], tuple[str, ...]]:
    """Put what the sources say into the mechanism file, which has the last word.

    Returns:
        The file, the named inputs, what the sources say that is left out, and what of it is worth a warning.

    Raises:
        UnknownNameError: for a motor that does not exist.
        InputError: for a joint that is locked while the one that it follows is not, or gravities that differ.
    """
    named = [p.prefixed(s.prefix) for s, p in zip(file.source, parts, strict=True)]
    joints = [s.prefix + n for s, p in zip(file.source, parts, strict=True) for n in joint_names(p.model)]
    couplings, lock = mimic_couplings(tuple(m for p in named for m in p.mimics), file.lock, joints)
    gravity = _gravity(file, named)
    motors = {m.name: m for p in named for m in p.motors}
    controls = {**{n: u for p in named for n, u in p.controls.items()}, **file.motor}
    changed = {*lock, *file.joint_type}
    tables = {}
    for key, table in file.start.tables.items():
        old = {n: x for p in named for n, x in p.start.tables[key].items() if n not in changed}
        tables[key] = {**old, **table}
    update: dict[str, Any] = {
        "lock": lock,
        "frame": (*(f for p in named for f in p.frames), *file.frame),
        "closure": (*(c for p in named for c in p.closures), *couplings, *file.closure),
        "driver": (*(d for p in named for d in p.drivers), *file.driver),
        "force": (
            *(f for p in named for f in (*p.forces, *_carried(p.weightless, gravity))),
            *_driven(motors, controls),
            *file.force,
        ),
        "gravity": gravity,
        "start": file.start.model_copy(update=tables),
        "motor": {},
    }
    dry = [f for f in file.force if isinstance(f, JointFriction)]
    taken = {
        LIMITS: {s.joint for s in file.stop if s.limits},
        FRICTION: {n for f in dry for n in ([f.joint] if isinstance(f.joint, str) else f.joint or [None])},
    }
    left_out = [(s, rest) for s, p in zip(file.source, named, strict=True) for text in p.left_out
                if (rest := _untaken(text, taken))]  # fmt: skip
    remarks = tuple(text for s, text in left_out if not s.quiet)
    return file.model_copy(update=update), tuple(motors.values()), tuple(text for _, text in left_out), remarks


def _untaken(text: str, taken: Mapping[str, Collection[str | None]]) -> str:
    """What is left out without the joints whose limits are stops or whose friction acts; None among them means all."""
    for what, joints in taken.items():
        before, found, names = text.partition(f"{what} ")
        prefix = before.removesuffix(": ")
        if found and before in ("", f"{prefix}: "):
            left = [n for n in names.split(", ") if None not in joints and prefix + n not in joints]
            return before + found + ", ".join(left) if left else ""
    return text


def _driven(motors: Mapping[str, Motor], controls: Mapping[str, Any]) -> list[JointTorque]:
    for name in controls:
        if name not in motors:
            raise UnknownNameError("motor", name, motors)
    acting = [m for m in motors.values() if m.name in controls or any(m.bias)]
    return [JointTorque(torque=controls.get(m.name, 0.0), **m._asdict()) for m in acting]


def _gravity(file: MechanismFile, parts: Sequence[ImportedModel]) -> tuple[float, ...]:
    said = list(dict.fromkeys(p.gravity for p in parts if p.gravity))
    if "gravity" in file.model_fields_set or not said:
        return file.gravity
    if len(said) > 1:
        differing = " and ".join(str(list(g)) for g in said)
        raise InputError(f"sources say gravity {differing}: the mechanism file must say it")
    return said[0]


def _carried(weightless: Mapping[str, float], gravity: Sequence[float]) -> list[Wrench]:
    """Forces that carry the weight of masses which have none."""
    forces = {n: tuple(Constant(value=-mass * g) for g in gravity) for n, mass in weightless.items()}
    return [Wrench(name=n, frame=n, force=force) for n, force in forces.items() if any(gravity)]


def _is_urdf(path: Path) -> bool:
    """Whether the first element of an XML file is a robot."""
    first = re.search(r"<([A-Za-z][\w.-]*)", re.sub(r"<!--.*?-->", "", text_of(path), flags=re.DOTALL))
    return first is not None and first.group(1) == "robot"
