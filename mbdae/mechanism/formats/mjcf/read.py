"""MJCF: compiled by MuJoCo itself, then converted to a Pinocchio model with closures, forces and a start state.

MuJoCo's compiler resolves defaults, includes, angles and inertias, so the converted values are those that MuJoCo would
simulate with. Joint coordinates keep MuJoCo's values (``ref`` included); quaternions and the velocity of free joints
change according to `mbdae.mechanism.formats.mjcf.states`. A body with several joints becomes a chain of joints with
massless intermediate links. Equalities become exact closures: their softness (solref, solimp) is not carried over.
"""

import warnings
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
from ..reader import Reader
from ..schema import Source
from .actuators import actuators_of, disabled, springs_of, weightless
from .equalities import loops_of
from .file_checks import check_files
from .omissions import left_out, visuals
from .said import unread
from .states import from_mujoco, pose

REFERENCE = "qpos0"
ONE_AT_A_TIME = Lock()  # MuJoCo has one global warning handler for all threads
NUMBERS = (
    "body_mass", "body_inertia", "body_pos", "body_quat", "body_ipos", "body_iquat", "jnt_pos", "jnt_axis",
    "jnt_stiffness", "dof_armature", "dof_damping", "qpos0", "qpos_spring", "key_qpos", "key_qvel", "eq_data",
    "site_pos", "geom_pos", "geom_size", "actuator_gear", "actuator_gainprm",
    "actuator_biasprm",
)  # fmt: skip


class MjcfModel:
    """A compiled MuJoCo model with names for all objects, and the Pinocchio model built from it.

    Attributes:
        lib: the mujoco package.
        m: the mujoco.MjModel.
        model: the Pinocchio model.
        home: for each MuJoCo body the joint that carries it and its placement there.
        before: for each MuJoCo joint the joint that carries it and its placement there.
        joints: Pinocchio's name of each MuJoCo joint.
        sites: name of the frame of each MuJoCo site.
    """

    def __init__(self, lib: ModuleType, m: Any, name: str) -> None:
        self.lib, self.m = lib, m
        self.model = pin.Model()
        self.model.name = name
        self.home: list[tuple[int, pin.SE3]] = [(0, pin.SE3.Identity())]
        self.before: list[tuple[int, pin.SE3]] = []
        self._taken = {"world", "universe"}
        self.joints = [self._name("JOINT", j, "joint") for j in range(m.njnt)]
        self._taken = {"world", "universe"}  # joints and frames may share names
        bodies = [self._name("BODY", b, "body") for b in range(1, m.nbody)]
        for b, body in enumerate(bodies, 1):
            self._add_body(b, body)
        self.sites = [self._name("SITE", s, "site") for s in range(m.nsite)]
        for s, site in enumerate(self.sites):
            self.add_frame(site, m.site_bodyid[s], m.site_pos[s], m.site_quat[s])

    def name(self, kind: str, i: int) -> str:
        """Return the name from the file, or an empty one."""
        return self.lib.mj_id2name(self.m, getattr(self.lib.mjtObj, f"mjOBJ_{kind}"), i) or ""

    def is_scalar(self, j: int) -> bool:
        """Return whether a MuJoCo joint is a hinge or a slide."""
        kinds = self.lib.mjtJoint
        return kinds(self.m.jnt_type[j]) in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)

    def unique(self, name: str) -> str:
        """Return a frame name that is not used yet."""
        new, k = name, 2
        while new in self._taken:
            new, k = f"{name}_{k}", k + 1
        self._taken.add(new)
        return new

    def _name(self, kind: str, i: int, word: str) -> str:
        return self.unique(self.name(kind, i) or f"{word}{i}")

    def add_frame(self, name: str, body: int, position: np.ndarray, quaternion: np.ndarray | None = None) -> str:
        """Add a frame on a MuJoCo body; return its name."""
        joint, place = self.home[body]
        here = place * pose(position, quaternion)
        self.model.addFrame(pin.Frame(name, joint, here, pin.FrameType.OP_FRAME))
        return name

    def _add_body(self, b: int, name: str) -> None:
        m, (joint, place) = self.m, self.home[self.m.body_parentid[b]]
        place = place * pose(m.body_pos[b], m.body_quat[b])
        for j in range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b]):
            joint, place = self._add_joint(j, joint, place)
        self.home.append((joint, place))
        turn = pose(np.zeros(3), m.body_iquat[b]).rotation
        inertia = pin.Inertia(m.body_mass[b], m.body_ipos[b], turn @ np.diag(m.body_inertia[b]) @ turn.T)
        self.model.appendBodyToJoint(joint, inertia, place)
        self.model.addFrame(pin.Frame(name, joint, place, pin.FrameType.BODY))

    def _add_joint(self, j: int, parent: int, place: pin.SE3) -> tuple[int, pin.SE3]:
        """Add a joint; ``place`` is the body in the parent joint's frame before the joint, the result is that after."""
        m, kinds = self.m, self.lib.mjtJoint
        at, axis = pose(m.jnt_pos[j]), np.array(m.jnt_axis[j])
        ref, after = float(m.qpos0[m.jnt_qposadr[j]]), at.inverse()
        match kinds(m.jnt_type[j]):
            case kinds.mjJNT_FREE:
                place, joint, after = pin.SE3.Identity(), pin.JointModelFreeFlyer(), pin.SE3.Identity()
            case kinds.mjJNT_BALL:
                place, joint = place * at, pin.JointModelSpherical()
            case kinds.mjJNT_HINGE:
                place = place * at * pin.SE3(pin.exp3(-ref * axis), np.zeros(3))
                joint = pin.JointModelRevoluteUnaligned(axis)
            case kinds.mjJNT_SLIDE:
                place = place * at * pose(-ref * axis)
                joint = pin.JointModelPrismaticUnaligned(axis)
        self.before.append((parent, place))
        number = self.model.addJoint(parent, joint, place, self.joints[j])
        new = self.model.joints[number]
        ours, theirs = slice(new.idx_v, new.idx_v + new.nv), slice(m.jnt_dofadr[j], m.jnt_dofadr[j] + new.nv)
        self.model.armature[ours] = m.dof_armature[theirs]
        if new.nv == 6:  # in space, as a weightless mass at the origin: Pinocchio's would rotate with the body
            self.model.armature[ours.start : ours.start + 3] = 0
            origin = pin.Inertia(m.dof_armature[theirs.start], np.zeros(3), np.zeros((3, 3)))
            self.model.appendBodyToJoint(number, origin, pin.SE3.Identity())
        if m.jnt_limited[j] and new.nq == 1:
            (self.model.lowerPositionLimit[new.idx_q], self.model.upperPositionLimit[new.idx_q]) = m.jnt_range[j]
        self.model.upperDryFrictionLimit[ours] = m.dof_frictionloss[theirs]
        self.model.lowerDryFrictionLimit[ours] = -m.dof_frictionloss[theirs]
        if not disabled(self, "DAMPER"):
            self.model.damping[ours] = m.dof_damping[theirs]
        return number, after


def read_mjcf(path: Path, places: AllowedPaths, source: Source) -> ImportedModel:
    """Read an MJCF file.

    Args:
        path: the file; files that it includes are found as MuJoCo finds them.
        places: where the file may be.
        source: with the name of the keyframe to start from, ``"qpos0"`` for the reference configuration; the first
            keyframe, if there is one, when left out.

    Raises:
        InputError: if MuJoCo is missing, or cannot compile the file, or for a file that is not allowed.
        UnknownNameError: for an unknown keyframe.
    """
    try:
        import mujoco
    except ImportError:
        raise InputError(f"{path.name} is MJCF: reading it needs MuJoCo, pip install 'mbdae[mjcf]'") from None
    files = check_files(path, places)
    m = _compile(mujoco, path)
    _refuse_wild(m, path.name)
    c = MjcfModel(mujoco, m, path.stem)
    acting = actuators_of(c)
    frame = _key(c, source.key)
    start = _start(c, frame)
    control = m.key_ctrl[frame] if frame is not None else np.zeros(m.nu)
    gravity = (0.0, 0.0, 0.0) if disabled(c, "GRAVITY") else tuple(m.opt.gravity.tolist())
    closures, drivers, equalities = loops_of(c)
    forces, masses, (geometry, shapeless) = springs_of(c), weightless(c), visuals(c)
    return ImportedModel(
        c.model,
        geometry,
        lambda: {"model": model_to_data(c.model), "visuals": pack(geometry)},
        gravity=gravity,
        closures=tuple(closures),
        drivers=tuple(drivers),
        forces=tuple(forces),
        weightless=masses,
        start=start,
        motors=tuple(acting.motors.values()),
        controls={motor.name: float(control[i]) for i, motor in acting.motors.items() if control[i]},
        left_out=(*left_out(c, equalities, acting.others, acting.limited, shapeless), *unread(files)),
    )


def _compile(lib: ModuleType, path: Path) -> Any:
    said: list[str] = []
    with ONE_AT_A_TIME:
        before = lib.get_mju_user_warning()
        lib.set_mju_user_warning(said.append)  # otherwise MuJoCo writes them to a file in the working directory
        try:
            m = lib.MjModel.from_xml_path(str(path))
        except (ValueError, RuntimeError, lib.FatalError) as e:
            words = " ".join(str(e).split())
            raise InputError(f"{path.name} is not an MJCF file that MuJoCo compiles: {words}") from None
        finally:
            lib.set_mju_user_warning(before)
    for text in said:
        warnings.warn(f"{path.name}: MuJoCo says {text.strip()}", stacklevel=4)
    return m


def _refuse_wild(m: Any, name: str) -> None:
    """Reject numbers that are not finite, or whose products would overflow."""
    for array in NUMBERS:
        if not np.abs(getattr(m, array)).max(initial=0) <= HUGE:
            raise InputError(f"{name}: {array} is not finite, or beyond {HUGE:g}")
    if not np.abs(m.opt.gravity).max() <= HUGE:
        raise InputError(f"{name}: gravity is not finite, or beyond {HUGE:g}")


def _key(c: MjcfModel, key: str) -> int | None:
    names = [c.name("KEY", k) or f"key{k}" for k in range(c.m.nkey)]
    if key in names:
        return names.index(key)
    if key not in ("", REFERENCE):
        raise UnknownNameError("keyframe", key, [*names, REFERENCE])
    return 0 if names and not key else None


def _start(c: MjcfModel, key: int | None) -> Start:
    qpos, qvel = (c.m.qpos0, np.zeros(c.m.nv)) if key is None else (c.m.key_qpos[key], c.m.key_qvel[key])
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
    refused={"free_flyer": "does not belong to an MJCF source: {} has free joints of its own"},
)
