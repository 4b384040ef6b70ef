"""MJCF: compiled by MuJoCo, then converted to a Pinocchio model with closures, forces and an initial state.

The compiler of MuJoCo resolves defaults, includes, angles and inertias, so the converted values are the same as in
MuJoCo's simulation. Joint coordinates keep MuJoCo's values (``ref`` included); quaternions and the velocity of free
joints change according to `mbdae.mechanism.formats.mjcf.states`. A body with several joints becomes a chain of joints
with massless intermediate links. Equalities become exact closures: their softness (solref, solimp) is not carried over.
"""

import warnings
from functools import partial
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin

from ....errors import InputError, UnknownNameError
from ...allowed_paths import AllowedPaths
from ...checked_table import HUGE
from ...imported_model import ImportedModel
from ...model_serialization import model_to_data
from ...model_settings import Start
from ...scene.shapes import pack
from ..body_tables import Source
from ..reader import Reader
from .actuators import actuators_of, springs_of, weightless_masses
from .compiled_model import MjcfModel
from .equalities import closures_of
from .file_checks import check_files
from .geoms import visuals
from .states import from_mujoco
from .unread_contents import unread
from .unsupported_features import unsupported_features

REFERENCE = "qpos0"
COMPILER_LOCK = Lock()  # MuJoCo has one global warning handler for all threads
CHECKED_ARRAYS = (
    "body_mass", "body_inertia", "body_pos", "body_quat", "body_ipos", "body_iquat", "jnt_pos", "jnt_axis", "jnt_range",
    "jnt_stiffness", "dof_armature", "dof_damping", "dof_frictionloss", "qpos0", "qpos_spring", "key_qpos", "key_qvel",
    "key_ctrl", "eq_data", "site_pos", "site_quat", "geom_pos", "geom_quat", "geom_size", "mesh_vert", "actuator_gear",
    "actuator_gainprm", "actuator_biasprm",
)  # fmt: skip
MUJOCO_4_ARRAYS = ("actuator_armature", "actuator_damping")  # missing in earlier versions


def read_mjcf(path: Path, allowed: AllowedPaths, source: Source) -> ImportedModel:
    """Read an MJCF file.

    Args:
        path: the file; included files are resolved as in MuJoCo.
        allowed: paths of the files that may be read.
        source: options, with the keyframe of the initial state: by default the first, if any; ``"qpos0"`` for the
            reference configuration.

    Raises:
        InputError: if MuJoCo is missing or cannot compile the file, or if a file is not allowed.
        UnknownNameError: for an unknown keyframe.
    """
    try:
        import mujoco
    except ImportError:
        raise InputError(f"{path.name} is MJCF: reading it needs MuJoCo, pip install 'mbdae[mjcf]'") from None
    files = check_files(path, allowed)
    m = _compile(mujoco, path)
    _require_finite(m, path.name)
    c = MjcfModel(mujoco, m, path.stem)
    actuators = actuators_of(c)
    keyframe = _keyframe_index(c, source.key)
    start = _start(c, keyframe)
    control = m.key_ctrl[keyframe] if keyframe is not None else np.zeros(m.nu)
    gravity = (0.0, 0.0, 0.0) if c.disables("GRAVITY") else tuple(m.opt.gravity.tolist())
    closures, drivers, equalities = closures_of(c)
    forces, weightless = springs_of(c), weightless_masses(c)
    geometry, shapeless = visuals(c)
    unsupported = unsupported_features(c, equalities, actuators.unsupported, actuators.limited, shapeless)
    return ImportedModel(
        c.model,
        geometry,
        partial(_record, c.model, geometry),
        gravity=gravity,
        closures=tuple(closures),
        drivers=tuple(drivers),
        forces=tuple(forces),
        weightless=weightless,
        start=start,
        motors=tuple(actuators.motors.values()),
        controls={motor.name: float(control[i]) for i, motor in actuators.motors.items() if control[i]},
        left_out=(*unsupported, *unread(files)),
    )


def _record(model: pin.Model, geometry: pin.GeometryModel) -> dict[str, Any]:
    return {"model": model_to_data(model), "visuals": pack(geometry)}


def _compile(lib: ModuleType, path: Path) -> Any:
    texts: list[str] = []
    with COMPILER_LOCK:
        previous_handler = lib.get_mju_user_warning()
        lib.set_mju_user_warning(texts.append)  # otherwise MuJoCo writes warnings to a file in the working directory
        try:
            m = lib.MjModel.from_xml_path(str(path))
        except (ValueError, RuntimeError, lib.FatalError) as e:
            detail = " ".join(str(e).split())
            raise InputError(f"{path.name}: MuJoCo cannot compile this file: {detail}") from None
        finally:
            lib.set_mju_user_warning(previous_handler)
    for text in texts:
        warnings.warn(f"{path.name}: warning of MuJoCo: {text.strip()}", stacklevel=4)  # the caller of `load`
    return m


def _require_finite(m: Any, name: str) -> None:
    """Reject NaN and numbers above `HUGE`, whose products may overflow; comparisons with NaN are false."""
    for array in (*CHECKED_ARRAYS, *(x for x in MUJOCO_4_ARRAYS if hasattr(m, x))):
        if not float(np.abs(getattr(m, array)).max(initial=0)) <= HUGE:
            raise InputError(f"{name}: {array} is not finite, or beyond {HUGE:g}")
    if not np.abs(m.opt.gravity).max() <= HUGE:
        raise InputError(f"{name}: gravity is not finite, or beyond {HUGE:g}")


def _keyframe_index(c: MjcfModel, name: str) -> int | None:
    names = c.names("KEY", "key", range(c.m.nkey), set())
    if name in names:
        return names.index(name)
    if name not in ("", REFERENCE):
        raise UnknownNameError("keyframe", name, [*names, REFERENCE])
    return 0 if names and not name else None


def _start(c: MjcfModel, keyframe: int | None) -> Start:
    qpos, qvel = c.m.qpos0, np.zeros(c.m.nv)
    if keyframe is not None:
        qpos, qvel = c.m.key_qpos[keyframe], c.m.key_qvel[keyframe]
    q, v = from_mujoco(c.model, qpos, qvel)
    joints = [(n, c.model.joints[c.model.getJointId(n)]) for n in c.joints]
    guess = {n: _value(q[j.idx_q : j.idx_q + j.nq]) for n, j in joints}
    speed = {n: _value(v[j.idx_v : j.idx_v + j.nv]) for n, j in joints}
    return Start(guess=guess, guess_v={n: s for n, s in speed.items() if np.any(s)})


def _value(x: np.ndarray) -> float | tuple[float, ...]:
    return float(x[0]) if len(x) == 1 else tuple(x.tolist())


mjcf = Reader(
    "mjcf",
    (".xml", ".mjcf"),
    read_mjcf,
    rejected={"free_flyer": "does not belong to an MJCF source: {} declares its free joints"},
)
