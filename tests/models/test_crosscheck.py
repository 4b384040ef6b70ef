"""Trajectories against those of other programs: MuJoCo and Exudyn, with the machines modelled independently.

``pip install ".[crosscheck]"`` installs both; without one, its tests are skipped by name.
"""

import importlib
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.discovery import robots_directory

URDF = "double_pendulum_description/urdf/double_pendulum_simple.urdf"
ACCURACY = {"mujoco": 1e-7, "exudyn": 1e-8}  # achieved accuracy: rad, m


@pytest.fixture(scope="module", params=ACCURACY)
def program(request):
    """Return a function (machine, start, t) that calls another program."""
    pytest.importorskip(request.param, reason=f"{request.param} is not installed: pip install 'mbdae[crosscheck]'")
    machines = importlib.import_module(f"crosscheck_{request.param}")

    def ask(machine, start, t, **more):
        function = getattr(machines, machine)
        if request.param == "exudyn":
            return machines.extrapolated(function, start, t)
        return function(start, t, **more)

    ask.name, ask.accuracy = request.param, ACCURACY[request.param]
    return ask


@pytest.mark.parametrize("name", ["four_bar", "slider_crank"])
def test_planar_loops(name, program):
    mech, t = mbdae.load(name), np.linspace(0, 2, 21)
    theirs = program(name, mech.start[0], t)
    ours = mbdae.solve(mech, (0, 2), rtol=1e-11, t_eval=t).q
    assert np.ptp(ours, axis=0).min() > 0.1
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=program.accuracy)


def test_double_pendulum(program, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, t = tmp_path / "mechanism.toml", np.linspace(0, 1, 11)
    path.write_text(
        f'source = {{ file = "example-robot-data:{URDF}", quiet = true }}\n[[force]]\nkind = "joint_damping"\n'
        'joint = ["joint1", "joint2"]\ndamping = 0.0\n[start]\nq = { joint1 = 1.5, joint2 = 0.5 }'
    )
    mech = mbdae.load(path)
    more = {"urdf": robots_directory() / URDF} if program.name == "mujoco" else {}
    theirs = program("double_pendulum", mech.start[0], t, **more)
    ours = mbdae.solve(mech, (0, 1), rtol=1e-11, t_eval=t).q
    assert [file.name for file in tmp_path.iterdir()] == [path.name]  # no log of the warnings about the URDF
    assert np.ptp(ours, axis=0).min() > 1
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=program.accuracy)


@pytest.mark.slow
def test_stewart_platform(program):
    mech, t = mbdae.load("stewart_platform"), np.linspace(0, 0.4, 5)
    theirs = program("stewart_platform", hexapod(mech), t)
    q = mbdae.solve(mech, (0, 0.4), rtol=1e-10, t_eval=t).q
    ours = np.hstack([q[:, :3], [pin.Quaternion(x[3:7]).matrix().ravel() for x in q]])
    assert np.ptp(ours, axis=0).max() > 0.1
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=program.accuracy)


def hexapod(mech):
    """Start poses of the bodies, and the legs: foot, socket, home orientation and phase of each driver."""
    q, v = mech.start
    data = mech.model.createData()
    pin.forwardKinematics(mech.model, data, q, v)
    bodies = {n: (data.oMi[j], data.v[j]) for n in mech.joint_names for j in [mech.model.getJointId(n)]}
    base, platform = np.radians([[15, 105, 135, 225, 255, 345], [45, 75, 165, 195, 285, 315]])
    feet, sockets = (r * np.stack([np.cos(a), np.sin(a), 0 * a], axis=1) for r, a in ((0.5, base), (0.3, platform)))
    homes = [mech.model.jointPlacements[mech.model.getJointId(f"leg_{i}")].rotation for i in range(1, 7)]
    return SimpleNamespace(q=q, v=v, bodies=bodies, legs=list(zip(feet, sockets, homes, platform, strict=True)))
