"""Paths of points: from the solution between frames, so that fast points draw smooth curves."""

import numpy as np
import pytest

import mbdae
from mbdae.studies.replay.animation_tracks import traces


@pytest.fixture(scope="module")
def crank():
    """A crank of 0.1 m that turns at 60 rad/s."""
    speed = mbdae.Driver.at_speed("crank", 60.0, start=0.3)
    mech = mbdae.load("slider_crank", drivers=[speed])
    return mbdae.solve(mech, (0, 1), *mech.assemble({"crank": 0.3}, {"crank": 60.0}), rtol=1e-8)


def corners(points):
    """Angles between the pieces of a path."""
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    return np.arccos(np.clip(np.einsum("ij,ij->i", steps[1:], steps[:-1]), -1, 1))


def test_a_fast_point_draws_a_circle(crank):
    times = np.linspace(0, 1, 61)
    (path,) = traces(crank.mechanism, ["crank_pin"], lambda t: crank(t)[0], times)
    points = path["points"]
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.linalg.norm(points[0]), abs=1e-8)
    assert corners(points).max() <= 0.1
    assert points[:: (len(points) - 1) // 60].shape == (61, 3), "frames are points of the path"


def test_a_slow_point_has_the_points_of_its_frames(crank):
    times = np.linspace(0, 0.01, 61)
    (path,) = traces(crank.mechanism, ["crank_pin"], lambda t: crank(t)[0], times)
    assert len(path["points"]) == 61


def test_a_corner_ends_the_refinement():
    sol = mbdae.solve("pendulum_on_stop", (0, 2))
    (path,) = traces(sol.mechanism, [sol.mechanism.model.frames[-1].name], lambda t: sol(t)[0], np.linspace(0, 2, 61))
    assert 61 <= len(path["points"]) <= 6001
