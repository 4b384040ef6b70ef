"""Tension stiffens a beam, compression makes it buckle: spinning blades and columns against published values."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import eigh

import mbdae
from mbdae.errors import StepError
from mbdae.mechanism.formulations.equation_partials import equation_partials

UNIT = {"length": 1.0, "young": 1.0, "density": 1.0, "area": 1.0, "second_moment": 1.0, "elements": 30}
SPINNING = {2: (4.137320, 3.621797), 5: (6.449545, 4.073896), 10: (11.202328, 5.048975)}  # flap and chord, 60 elements


def stiffness(speed=0.0, gravity=0.0, load=0.0, **given):
    """The stiffness of the modes of a beam along x, turning about z, with gravity and a load at its tip along x."""
    model = pin.Model()
    model.gravity.linear = np.array([gravity, 0.0, 0.0])
    mbdae.attach_flexible(model, "blade", mbdae.beam(**UNIT | given), pin.JointModelRZ())
    force = mbdae.Wrench(frame="blade.B", force=(load, 0.0, 0.0))
    mech = mbdae.Mechanism(model, forces=[force] if load else [], drivers=[mbdae.Driver(joint="blade", speed=speed)])
    v, zero = np.zeros(mech.nv), np.zeros(mech.nv)
    v[0] = speed
    p = equation_partials(mech.system(), 0.0, zero, np.append(v, 0.0), zero, np.zeros(mech.ng), np.arange(mech.ng))
    return -p.K[1 : mech.nv, 1:]


@pytest.mark.parametrize("speed", SPINNING)
def test_frequencies_of_a_spinning_blade(speed):
    for plane, exact in zip("zy", SPINNING[speed], strict=True):
        lowest = np.sqrt(np.linalg.eigvalsh(stiffness(speed, plane=plane, modes=6))[0])
        assert lowest == pytest.approx(exact, rel=6e-4), plane
    linear = np.linalg.eigvalsh(stiffness(5, plane="y", modes=6, stiffening=False))[0]
    assert linear < 0  # without stiffening the blade diverges chordwise


WITH_SIX_MODES = {2: 4.137322, 5: 6.449627, 10: 11.203624}
BLADE = """
gravity = [0.0, 0.0, 0.0]
[[flexible]]
name = "blade"
parent = "world"
joint = "revolute"
length = 1.0
young = 1.0
density = 1.0
area = 1.0
second_moment = 1.0
elements = 60
modes = 6
"""


@pytest.mark.parametrize("plane", ["z", "y"])
def test_frequencies_over_the_speed_from_a_file(plane, tmp_path):
    """`mbdae root-locus blade.toml v.blade=2:10:5 --hold blade`."""
    (tmp_path / "blade.toml").write_text(f'{BLADE}plane = "{plane}"\n')
    locus = mbdae.root_locus(tmp_path / "blade.toml", "v.blade", [2.0, 5.0, 10.0], hold="blade")
    lowest = np.abs(locus.eigenvalues.imag).min(axis=1)
    exact = [SPINNING[speed]["zy".index(plane)] for speed in (2, 5, 10)]
    np.testing.assert_allclose(lowest, exact, rtol=6e-4)
    if plane == "z":
        np.testing.assert_allclose(lowest, list(WITH_SIX_MODES.values()), rtol=2e-7)


@pytest.mark.slow
def test_buckling_along_a_load_path():
    """The published errors of p normal modes: 8e-2 6e-3 9e-4 1e-4 for p = 1, 2, 4, 8."""
    for modes, error in ((1, 8e-2), (2, 6e-3), (4, 9e-4)):
        model = pin.Model()
        model.gravity.linear = np.zeros(3)
        mbdae.attach_flexible(model, "column", mbdae.beam(**UNIT, modes=modes), pin.JointModelRZ())
        load = mbdae.Wrench(name="load", frame="column.B", force=(-1.0, 0.0, 0.0))
        path = mbdae.load_path(mbdae.Mechanism(model, forces=[load]), "load", (0.0, 3.0), hold="column")
        assert path.critical[0].factor / (np.pi**2 / 4) - 1 == pytest.approx(error, rel=0.2)


def critical(loaded, free):
    """The lowest factor of a load at which the stiffness is singular."""
    return 1 / eigh(free - loaded, free, eigvals_only=True)[-1]


def test_euler_load_of_a_cantilever():
    """A force at the tip against the beam: pi^2/4 EI/L^2, from above, 3e-4 off with 6 normal modes."""
    found = critical(stiffness(load=-1.0, modes=6), stiffness(modes=6))
    assert found == pytest.approx(np.pi**2 / 4, rel=5e-4)
    assert found > np.pi**2 / 4


@pytest.mark.parametrize(("modes", "published"), [(1, 7.8697), (2, 7.8529), (4, 7.83816)])
def test_a_column_under_its_own_weight(modes, published):
    found = critical(stiffness(gravity=-1.0, modes=modes), stiffness(modes=modes))
    assert found == pytest.approx(published, rel=2e-5)


def test_energy_of_a_spinning_blade_that_bends_far():
    """Coupled with the hub, at a fifth of its length: the shortening is part of the kinetic energy."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    mbdae.attach_flexible(model, "blade", mbdae.beam(**UNIT, modes=3), pin.JointModelRZ())
    mech = mbdae.Mechanism(model)
    sol = mbdae.solve(mech, (0, 2), [0, 0.1, 0, 0], [5.0, 0, 0, 0], method="pherk6", rtol=1e-10, atol=1e-12)
    states = list(zip(sol.q[::10], sol.v[::10], strict=True))
    energy = [sum(mech.energy(q, v)) for q, v in states]
    assert np.ptp(energy) < 1e-8 * max(energy)
    moment = [(mech.mass_matrix(q) @ v)[0] for q, v in states]
    assert np.ptp(moment) < 1e-9 * max(moment)


@pytest.fixture(scope="module")
def without_hub():
    model = pin.Model()
    mbdae.attach_flexible(model, "blade", mbdae.beam(**UNIT, modes=5), pin.JointModelRZ())
    return mbdae.Mechanism(model)


def inertia_at(mech, tip):
    q = np.zeros(mech.nq)
    q[1] = tip / mech.model.flexible[0].modal.nodes["B"].Phi[1, 0]
    return mech.system().inertia(0.0, q)


def test_a_beam_without_a_hub_has_inertia(without_hub):
    """The clamped modes span nearly all of the rotation of the frame: at most 1 - sum H0_i^2/(I Mq_ii) is left."""
    for tip, error in ((0.0, 2e-3), (0.05, 2e-2), (0.15, 0.4)):
        U = inertia_at(without_hub, tip)
        left = 1 / np.linalg.inv(U.T @ U)[0, 0]  # of I = 1/3
        assert 3 * left == pytest.approx(3.22e-4, rel=error)


def test_a_beam_without_a_hub_that_bends_too_far_is_named(without_hub):
    with pytest.raises(StepError, match=r"singular at joint 'blade.mode \d', .* 'blade' bends too far .* fewer modes"):
        inertia_at(without_hub, 0.3)


SPIN_UP = """
gravity = [0.0, 0.0, 0.0]
[[flexible]]
name = "beam"
parent = "world"
joint = "revolute"
length = 10.0
young = 7e10
density = 3000.0
area = 4e-4
second_moment = 2e-7
elements = 16
modes = 3
stiffening = STIFFENING
[[driver]]
joint = "beam"
speed = { kind = "table", beyond = "hold", points = POINTS }
"""


def spin_up(folder, stiffening, end):
    """The beam of Kane, Ryan and Banerjee (1987): 0 to 6 rad/s in 15 s, w(t) = 0.4 (t - 15/(2 pi) sin(2 pi t/15))."""
    t = np.linspace(0, 15, 31)
    w = 0.4 * (t - 7.5 / np.pi * np.sin(2 * np.pi * t / 15))
    points = str([list(pair) for pair in zip(t.tolist(), w.tolist(), strict=True)])
    (folder / "spin_up.toml").write_text(SPIN_UP.replace("STIFFENING", stiffening).replace("POINTS", points))
    return mbdae.solve(folder / "spin_up.toml", (0, end), rtol=1e-6)


def test_spin_up(tmp_path):
    """The tip lags by 0.57 m at most, at 6.8 s, and then vibrates by millimetres; the linear model diverges."""
    sol = spin_up(tmp_path, "true", 20)
    lag = sol.q[:, 1:] @ sol.mechanism.model.flexible[0].modal.nodes["B"].Phi[1]
    assert sol.status == "finished"
    assert -lag.min() == pytest.approx(0.57, abs=0.01)
    assert sol.t[lag.argmin()] == pytest.approx(6.8, abs=0.1)
    assert np.abs(lag[sol.t > 15.5]).max() < 5e-3
    linear = spin_up(tmp_path, "false", 12)
    assert linear.status == "doubtful"
    assert "beam bends beyond the range of linear modes" in linear.message
