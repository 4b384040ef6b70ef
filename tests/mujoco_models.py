"""The MJCF files of the tests, as mbdae reads them and as MuJoCo compiles them."""

import warnings
from pathlib import Path

import mbdae

DATA = Path(__file__).parent / "data" / "mjcf"
FILES = ("trees", "many_joints", "loops", "actuated", "open_four_bar", "heavy_rotor")


def load(name, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # what is not carried over has a test of its own
        return mbdae.load(DATA / f"{name}.xml", **options)


def compiled(name):
    import mujoco

    m = mujoco.MjModel.from_xml_path(str(DATA / f"{name}.xml"))
    m.opt.density = m.opt.viscosity = 0.0  # not carried over, as the warning says
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return m, mujoco.MjData(m)
