"""The MJCF files of the tests, as mbdae reads them and as MuJoCo compiles them."""

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin

import mbdae
from mbdae.mechanism import from_mujoco, to_mujoco

DATA = Path(__file__).parent / "data" / "mjcf"
FILES = ("trees", "many_joints", "loops", "actuated", "open_four_bar", "heavy_rotor")


def load(name, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # omissions have a separate test
        return mbdae.load(DATA / f"{name}.xml", **options)


def compiled(name):
    import mujoco

    m = mujoco.MjModel.from_xml_path(str(DATA / f"{name}.xml"))
    m.opt.density = m.opt.viscosity = 0.0  # not carried over, as in the warning
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return m, mujoco.MjData(m)


def at(mech, m, d, q, v):
    """Set a state in MuJoCo; return T with v = T qvel, and T' qvel."""
    import mujoco

    d.qpos[:], d.qvel[:] = to_mujoco(mech.model, q, v)
    mujoco.mj_forward(m, d)
    T = np.array([from_mujoco(mech.model, d.qpos, e)[1] for e in np.eye(m.nv)]).T
    transport = np.zeros(m.nv)
    for j in list(mech.model.joints)[1:]:
        if j.shortname() == "JointModelFreeFlyer":  # linear velocity in the body: d/dt (R^T v) = R^T v' - w x R^T v
            i = j.idx_v
            transport[i : i + 3] = -np.cross(v[i + 3 : i + 6], v[i : i + 3])
    return T, transport


def mass_matrix(mech, q):
    M = pin.crba(mech.model, mech.model.createData(), q)
    return np.triu(M) + np.triu(M, 1).T
