"""Continuation of a driver beyond its table, against closed forms, in both back ends."""

import numpy as np
import pytest
from chains import tree

import mbdae
from mbdae import Driver, JointTorque, Mechanism
from mbdae.errors import InputError

BACKENDS = ["native", "python"]
T = 0.8  # s
UP = [(0.0, 0.0), (T, 0.5)]
UP_AND_DOWN = [*UP, (2 * T, 0.0)]


def slider(points=UP, force=(), **more):
    """A slider moved by a table over 0.5 m."""
    return Mechanism(tree(["prismatic"], [0]), (), force, drivers=[Driver.table("prismatic_0", points, **more)])


def run(mech, end, backend, **options):
    return mbdae.solve(mech, (0.0, end), **{"rtol": 1e-8, "method": "pherk5", **options}, backend=backend)


def rise(s):
    """The cubic from 0 to 1 with zero end velocities."""
    return 3 * s**2 - 2 * s**3


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_run_ends_with_the_table(backend):
    sol = run(slider(), 3.0, backend)
    assert sol.status == "driver"
    assert not sol.success
    assert "the table of driver 'prismatic_0 driver' is known from t = 0 to 0.8 s only" in sol.message
    assert "beyond: 'hold', 'linear', 'periodic'" in sol.message
    assert sol.t[-1] == T
    np.testing.assert_allclose(sol.q[:, 0], 0.5 * sol.t / T, atol=1e-12)
    assert run(slider(), T, backend).status == "finished"
    backward = mbdae.solve(slider(), (T, -1.0), rtol=1e-6, backend=backend)
    assert (backward.status, backward.t[-1]) == ("driver", 0.0)


def test_a_run_outside_of_the_table_is_rejected():
    for span in ((0.9, 2.0), (-0.1, 0.5), (T, 1.0), (0.0, -1.0)):
        with pytest.raises(InputError, match=r"is known from t = 0 to 0\.8 s only"):
            mbdae.solve(slider(), span)
    with pytest.raises(InputError, match=r"got t = 0\.9"):
        slider().start_at(0.9)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("interpolation", ["spline", "monotone"])
def test_what_holds_comes_to_rest(backend, interpolation):
    """Without a jump of speed, which would be an impact: between its ends u is the clamped cubic."""
    mech = slider()
    motion = {"kind": "table", "points": UP_AND_DOWN, "interpolation": interpolation, "beyond": "hold"}
    mech = Mechanism(mech.model, drivers=[Driver(joint="prismatic_0", motion=motion)])
    sol = run(mech, 2.5, backend)
    assert sol.status == "finished"
    u = np.where(sol.t < T, rise(sol.t / T), rise(2 - np.minimum(sol.t, 2 * T) / T))
    np.testing.assert_allclose(sol.q[:, 0], 0.5 * u, atol=1e-10)
    np.testing.assert_allclose(sol.v[sol.t > 2 * T], 0, atol=1e-12)
    assert 2 * T in sol.t  # u'' jumps there
    assert abs(mbdae.drift(sol).energy_relative) < 1e-6


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_periodic_motion_repeats_itself(backend):
    """Smooth across periods, so that by symmetry u' = 0 at its ends and in its middle."""
    sol = run(slider(UP_AND_DOWN, beyond="periodic"), 6.0, backend)
    phase = np.abs((sol.t / T + 1) % 2 - 1)
    np.testing.assert_allclose(sol.q[:, 0], 0.5 * rise(phase), atol=1e-8)
    earlier = mbdae.solve(slider(UP_AND_DOWN, beyond="periodic"), (-4.0, -3.0), rtol=1e-8, backend=backend)
    np.testing.assert_allclose(earlier.q[:, 0], 0.5 * rise(np.abs((earlier.t / T + 1) % 2 - 1)), atol=1e-8)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("beyond", ["linear", "periodic"])
def test_a_line_goes_on(backend, beyond):
    sol = run(slider(beyond=beyond), 3.0, backend)
    np.testing.assert_allclose(sol.q[:, 0], 0.5 * sol.t / T, atol=1e-10)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_periodic_force(backend):
    """On a free slider of mass m: v = integral of the force / m, 0.4 N s in each period of 1.6 s."""
    force = {"kind": "table", "points": UP_AND_DOWN, "beyond": "periodic"}
    mech = Mechanism(tree(["prismatic"], [0]), forces=[JointTorque(joint="prismatic_0", torque=force, name="pull")])
    at_rest = Mechanism(mech.model, forces=[JointTorque(joint="prismatic_0", torque=0.0)])
    options = {"rtol": 1e-9, "backend": backend, "t_eval": [0.0, 2 * T, 4 * T, 8 * T]}
    v = (mbdae.solve(mech, (0, 8 * T), **options).v - mbdae.solve(at_rest, (0, 8 * T), **options).v)[:, 0]
    np.testing.assert_allclose(v / v[1], [0, 1, 2, 4], atol=1e-6)
    mass = mech.system().inertia(0.0, np.zeros(1))[0, 0] ** 2
    assert v[1] == pytest.approx(0.4 / mass, rel=1e-6)
    with pytest.raises(InputError, match="a periodic table of a load or speed ends with the value that it begins with"):
        JointTorque(joint="prismatic_0", torque={**force, "points": UP})


def test_tables_that_repeat_too_often_are_rejected_with_mode_switches():
    motion = {"kind": "table", "points": [(0.0, 0.0), (1e-7, 1e-9), (2e-7, 0.0)], "beyond": "periodic"}
    stop = mbdae.Stop(joint="prismatic_1", lower=-1.0)
    drivers = [Driver(joint="prismatic_0", motion=motion)]
    mech = Mechanism(tree(["prismatic", "prismatic"], [0, 0]), drivers=drivers, stops=[stop])
    with pytest.raises(InputError, match="repeats every 2e-07 s"):
        mbdae.solve(mech, (0, 10))
