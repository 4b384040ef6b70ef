"""Flexible bodies whose frame is fixed to the world or to a rigid body: cantilevers against closed forms."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.finite_differences import numerical_derivative
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel
from mbdae.mechanism.signals.momentum import momentum
from mbdae.mechanism.tree.tree_terms import copy_model

LENGTH, YOUNG, DENSITY, AREA, MOMENT = 1.0, 2.1e11, 7850.0, 1e-4, 8e-10
BEAM = f"""
name = "beam"
joint = "fixed"
length = {LENGTH}
young = {YOUNG}
density = {DENSITY}
area = {AREA}
second_moment = {MOMENT}
elements = 16
damping = 0.01
"""
CANTILEVER = f"""
gravity = [0.0, -9.81, 0.0]
[[flexible]]
parent = "world"
{BEAM}
xyz = [0.1, 0.2, 0.0]
stiffening = false
loads = ["gravity y"]
"""
HUB = f"""
gravity = [0.0, 0.0, 0.0]
[[body]]
name = "hub"
parent = "world"
mass = 2.0
com = [0.1, 0.0, 0.0]
inertia = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]
[[flexible]]
parent = "hub"
{BEAM}
rpy = [0.0, 0.0, 0.7]
plane = "PLANE"
"""
PERIOD = np.sqrt(DENSITY * AREA * LENGTH**4 / (YOUNG * MOMENT))  # unit of time of a bending beam, in s
SPEED, FLAP, CHORD = 5.0, 6.449545, 4.073896  # in 1/PERIOD: 60 elements, hub radius 0


def write(folder, text):
    (folder / "mechanism.toml").write_text(text)
    return folder / "mechanism.toml"


@pytest.fixture(scope="module")
def cantilever(tmp_path_factory):
    return mbdae.load(write(tmp_path_factory.mktemp("cantilever"), CANTILEVER))


def test_a_cantilever_has_no_joint_but_its_modes(cantilever):
    assert cantilever.joint_names == [f"beam.mode {i + 1}" for i in range(5)]
    exact = np.array([3.5160152685, 22.0344915647]) / PERIOD
    np.testing.assert_allclose(cantilever.model.flexible[0].modal.frequencies[:2], exact, rtol=1e-5)


def test_sag_of_a_cantilever(cantilever):
    """At rest its tip is rho A g L^4/(8 EI) lower."""
    at = mbdae.equilibrium(cantilever)
    sag = DENSITY * AREA * 9.81 * LENGTH**4 / (8 * YOUNG * MOMENT)
    tip = cantilever.model.flexible[0].modal.nodes["B"].Phi[1]
    assert tip @ at.q == pytest.approx(-sag, rel=1e-9)


def test_centre_of_mass_of_a_cantilever(cantilever):
    """The beam and its mean deflection at rest, rho A g L^4/(20 EI), with and without a ball that is free."""
    q = mbdae.equilibrium(cantilever).q
    found = momentum(cantilever.model, q[None], np.zeros((1, cantilever.nv)))
    sag = DENSITY * AREA * 9.81 * LENGTH**4 / (20 * YOUNG * MOMENT)
    middle = np.array([0.1 + LENGTH / 2, 0.2 - sag, 0.0])
    np.testing.assert_allclose([found[f"com.{x}"][0] for x in "xyz"], middle, rtol=1e-8)
    model, beam, ball = copy_model(cantilever.model), DENSITY * AREA * LENGTH, 0.27
    joint = model.addJoint(0, pin.JointModelPY(), pin.SE3(np.eye(3), np.array([5.0, 0.0, 0.0])), "ball")
    model.appendBodyToJoint(joint, pin.Inertia(ball, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    found = momentum(model, np.append(q, 1.0)[None], np.append(np.zeros(len(q)), 2.0)[None])
    exact = (beam * middle + ball * np.array([5.0, 1.0, 0.0])) / (beam + ball)
    np.testing.assert_allclose([found[f"com.{x}"][0] for x in "xyz"], exact, rtol=1e-8)
    spin = ball * 2.0 * (5.0 - exact[0])  # about the centre of mass of both
    assert found["angular_momentum.z"][0] == pytest.approx(spin, rel=1e-8)


@pytest.mark.parametrize(("plane", "exact"), [("z", FLAP), ("y", CHORD)])
def test_a_blade_fixed_to_a_hub_that_spins(tmp_path, plane, exact):
    path = write(tmp_path, HUB.replace("PLANE", plane))
    locus = mbdae.root_locus(path, "v.hub", [SPEED / PERIOD], hold="hub")
    assert np.abs(locus.eigenvalues.imag).min() * PERIOD == pytest.approx(exact, rel=6e-4)


@pytest.mark.parametrize("backend", ["native", "python"])
def test_momentum_and_energy_of_a_hub_with_a_beam(tmp_path, backend):
    mech = mbdae.load(write(tmp_path, HUB.replace("PLANE", "y").replace("damping = 0.01", "")))
    sol = mbdae.solve(mech, (0, 0.02), [0.1, 0.02, 0, 0, 0], [20.0, 0, 0, 0, 0], rtol=1e-9, backend=backend)
    energy = [sum(mech.energy(q, v)) for q, v in zip(sol.q, sol.v, strict=True)]
    assert np.ptp(energy) < 1e-7 * max(energy)
    about_hub = [(mech.mass_matrix(q) @ v)[0] for q, v in zip(sol.q, sol.v, strict=True)]
    assert np.ptp(about_hub) < 1e-8 * max(about_hub)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flexible.beam.density", "flexible.beam.young"])
def test_gradients_of_a_fixed_beam(tmp_path, cantilever, name):
    start, run = np.array([0.01, 0, 0, 0, 0]), {"method": "pherk5", "step": 1e-4}
    hub = mbdae.load(write(tmp_path, HUB.replace("PLANE", "y")))
    for mech, q in ((cantilever, start), (hub, start[[1, 0, 2, 3, 4]])):
        found = mbdae.sensitivity(mbdae.solve(mech, (0, 5e-3), q, **run), [name])
        value = {"density": DENSITY, "young": YOUNG}[name.rpartition(".")[2]]

        def end(x, mech=mech, q=q, value=value):
            sol = mbdae.solve(LoadedModel(mech).make({name: value * (1 + x)}), (0, 5e-3), q, **run)
            return np.concatenate([sol.q[-1], sol.v[-1]])

        quotient = numerical_derivative(end, 2e-3) / value
        ours = np.concatenate([found.q[-1], found.v[-1]]).ravel()
        np.testing.assert_allclose(ours, quotient, atol=1e-8 * np.abs(quotient).max())


def test_friction_of_all_joints_is_not_one_of_modes(tmp_path):
    hub = write(tmp_path, HUB.replace("PLANE", "y"))
    moving = mbdae.load(hub, forces=[mbdae.JointFriction(friction=3.0)])
    v = np.ones(moving.nv)
    free, slowed = (np.array(m.system().force(0.0, m.start[0], v, np.empty(0))[0]) for m in (mbdae.load(hub), moving))
    np.testing.assert_allclose(slowed - free, -3.0 * np.eye(moving.nv)[0], rtol=0, atol=1e-12)
    sticking = mbdae.load(hub, forces=[mbdae.JointFriction(friction=3.0, exact=True)])
    assert [c.name for c in sticking.constraints] == ["hub friction"]
