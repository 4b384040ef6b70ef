"""Impulses of contacts at more points than the motion determines: the shortest ones, the same in both back ends."""

from itertools import combinations

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae import Closure, CoulombFriction, Mechanism
from mbdae.errors import InputError
from mbdae.mechanism.hybrid.impact_law import solve_impact

G, HEIGHT, PLACES = 9.81, 0.2, ((0.1, 0.08), (0.1, -0.08), (-0.1, 0.08), (-0.1, -0.08))


def box(restitution=0.0, com=0.0, forces=()):
    """A box of 1 kg above the floor, with a contact at each of its lower corners."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    model.appendBodyToJoint(
        joint, pin.Inertia(1.0, np.array([com, 0, 0]), np.diag([0.01, 0.02, 0.025])), pin.SE3.Identity()
    )
    for i, (x, y) in enumerate(PLACES):
        place = pin.SE3(np.eye(3), np.array([x, y, -0.05]))
        model.addFrame(pin.Frame(f"corner {i}", joint, 0, place, pin.FrameType.OP_FRAME))
    more = {"kind": "in_plane", "unilateral": True, "restitution": restitution}
    corners = [Closure(frames=("world", f"corner {i}"), name=f"corner {i}", **more) for i in range(4)]
    return Mechanism(model, corners, forces)


@pytest.mark.parametrize("com", [0.0, 0.03])
def test_a_box_falls_on_four_corners(com):
    """m v/4 each; with the centre of mass at d, m v/4 (1 +- d/a) by the balance of moments, the sides being equal."""
    runs = {}
    for backend in ("native", "python"):
        q = np.array([0, 0, HEIGHT + 0.05, 0, 0, 0, 1.0])
        runs[backend] = mbdae.solve(box(com=com), (0, 0.21), q, np.zeros(6), rtol=1e-9, backend=backend).impacts[0]
    expected = np.sqrt(2 * G * HEIGHT) / 4 * np.array([1 + com / x for x, _ in PLACES])
    for impact in runs.values():
        assert impact.where == tuple(f"corner {i}" for i in range(4))
        assert impact.impulse == pytest.approx(expected, rel=1e-9)
    assert runs["native"].impulse == pytest.approx(runs["python"].impulse, rel=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_the_shortest_of_all_impulses(seed):
    """Against the shortest over all subsets of contacts that alone give the same change of velocity."""
    rng, n, m = np.random.default_rng(seed), 3, 6
    A = rng.normal(size=(n, n))
    M = A @ A.T + np.eye(n)
    rows = np.column_stack([np.ones(m), rng.uniform(-1, 1, (m, 2))])
    v = np.array([-1.0, 0.0, 0.0])
    found = solve_impact(np.linalg.cholesky(M).T, np.zeros((0, n)), np.zeros(0), rows, np.zeros(m), np.zeros(m), v)
    change = M @ (found.v - v)
    np.testing.assert_allclose(rows.T @ found.p, change, atol=1e-10)
    assert (found.p >= 0).all()
    least = np.inf
    for k in range(1, m + 1):
        for which in map(list, combinations(range(m), k)):
            if (rows[which] @ found.v > 1e-9).any():
                continue
            p = np.linalg.pinv(rows[which].T) @ change
            if (p >= -1e-12).all() and np.abs(rows[which].T @ p - change).max() < 1e-9:
                least = min(least, float(np.linalg.norm(p)))
    assert np.linalg.norm(found.p) == pytest.approx(least, rel=1e-8)


def test_exact_friction_without_grip_is_one_line():
    with pytest.raises(InputError, match=r"^friction of 'corner 0': exact friction belongs to closures of kind"):
        box(forces=[CoulombFriction(closure="corner 0", coefficient=0.3, exact=True)])
