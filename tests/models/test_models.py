"""The models that come with mbdae: pages, start states, and mechanics against formulas written here."""

import json
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from numpy import cos, sin
from scipy.special import ellipj, ellipk
from signal_names import without_work

import mbdae

MODELS = Path(__file__).parents[2] / "models"
NAMES = mbdae.model_names()
DATA_FILE = re.compile(r"^file = \"([^:\"]+)\"", re.MULTILINE)  # beside the model
TABLE_HEAD = "| nq | nv | rows | rank | degrees of freedom |"


def jacobian(mech, q):
    """G(q) over all rows, (ng, nv), column by column."""
    return np.array([mech.residual(q, e)[1] for e in np.eye(mech.nv)]).T


def mass(mech, q):
    upper = np.triu(pin.crba(mech.model, mech.model.createData(), q))
    return upper + np.triu(upper, 1).T


def accelerate(mech, q, v):
    """v' (nv,) and lam (ng,) from the hidden constraint, also away from g = 0."""
    y = mech.point()
    y[: mech.nq], y[mech.nq : mech.nq + mech.nv] = q, v
    derivative, lam = mech.system().derivative(0.0, y)
    return derivative[mech.nv : 2 * mech.nv], lam


def body(mech, joint):
    """Mass, centre of mass and rotational inertia about it of the body of a joint."""
    inertia = mech.model.inertias[mech.model.getJointId(joint)]
    return inertia.mass, inertia.lever, inertia.inertia


def place(mech, q, frame):
    data = mech.model.createData()
    pin.framesForwardKinematics(mech.model, data, q)
    index = next(i for i, f in enumerate(mech.model.frames) if f.name == frame)
    return data.oMf[index]


# -- every model ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_start_is_consistent(name):
    mech = mbdae.load(name)
    g, gv = mech.residual(*mech.start)
    assert np.abs(g).max(initial=0) <= 1e-10
    assert np.abs(gv).max(initial=0) <= 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_readme(name):
    mech = mbdae.load(name)
    text = (MODELS / name / "README.md").read_text()
    assert text.startswith(f"# {name}\n")
    for word in ("Origin:", "icence", "Coordinates:", "Of interest:"):
        assert word in text, f"the README of {name} lacks {word!r}"
    numbers = [int(x) for x in text.split(TABLE_HEAD)[1].splitlines()[2].strip("| ").split("|")]
    rank = np.linalg.matrix_rank(jacobian(mech, mech.start[0]), tol=1e-9)
    assert numbers == [mech.nq, mech.nv, mech.ng, rank, mech.nv - rank]


@pytest.mark.parametrize("name", NAMES)
def test_a_second_is_run_and_checked_and_replayed(name, tmp_path, monkeypatch):
    monkeypatch.setattr("mbdae.studies.replay.plot_panels.POINTS", 100)
    monkeypatch.setattr("mbdae.studies.replay.replay.MAX_FRAMES", 20)
    mech = mbdae.load(name)
    assert mech.duration >= mech.order.T
    assert mech.order.steps >= 10
    sol = mbdae.solve(mech, (0, min(1.0, mech.duration)), rtol=1e-6)
    assert sol.success, sol.message
    found = mbdae.drift(sol)
    assert max(found.g_max, found.Gv_max / max(1, np.abs(sol.v).max()), found.energy_relative) < 1e-5
    assert mbdae.animate(sol, tmp_path / "run.html").stat().st_size < 1e7
    few = sol.resampled(np.linspace(0, sol.t[-1], 9))  # signals of every step take most of the test's time
    assert list(few.signals()) == list(without_work(mech))


# -- pendulum ------------------------------------------------------------------------------------------------------


def test_pendulum_has_the_elliptic_solution():
    mech = mbdae.load("pendulum")
    q, v = mech.start
    assert q.tolist() == [-1, 0, 0]
    assert v.tolist() == [0, 0, 0]
    omega, m = np.sqrt(9.81), 0.5  # m = k^2, k = sin 45 degrees
    t = np.linspace(0, 5, 21)
    sol = mbdae.solve(mech, (0, 5), rtol=1e-11, t_eval=t)
    phi = -2 * np.arcsin(np.sqrt(m) * ellipj(ellipk(m) - omega * t, m)[0])
    np.testing.assert_allclose(sol.q, np.stack([sin(phi), 0 * t, -cos(phi)], axis=1), atol=1e-7)
    assert not sol.q[:, 1].any()


def test_pendulum_string_pulls_with_three_weights_in_the_lowest_point():
    mech = mbdae.load("pendulum")
    vdot, lam = accelerate(mech, np.array([0, 0, -1.0]), np.array([np.sqrt(2 * 9.81), 0, 0]))
    np.testing.assert_allclose(lam, [-3 * 9.81], rtol=1e-14)
    np.testing.assert_allclose(vdot, [0, 0, 2 * 9.81], rtol=1e-14)


# -- four_bar ------------------------------------------------------------------------------------------------------


def test_four_bar_geometry():
    mech = mbdae.load("four_bar")
    for joint, length in {"crank": 1.0, "coupler": 2.0, "rocker": 1.5}.items():
        m, com, inertia = body(mech, joint)
        assert m == length
        assert com.tolist() == [length / 2, 0, 0]
        np.testing.assert_allclose(np.diag(inertia)[1:], m * length**2 / 12, rtol=1e-15)
    np.testing.assert_array_equal(mech.model.gravity.linear, [0, 0, -9.81])
    assert mech.nq == 3  # wide-limit hinges: one angle each

    q, v = mech.start
    crank, coupler, rocker = q
    assert crank == 1.2
    assert not v.any()
    pin_a = np.array([cos(crank) + 2 * cos(crank + coupler), sin(crank) + 2 * sin(crank + coupler)])
    pin_b = np.array([2 + 1.5 * cos(rocker), 1.5 * sin(rocker)])
    np.testing.assert_allclose(pin_a, pin_b, atol=1e-15)
    assert pin_a[1] > np.tan(np.arctan2(sin(1.2), cos(1.2) - 2)) * (pin_a[0] - 2)  # above crank pin to rocker pivot
    np.testing.assert_allclose(place(mech, q, "rocker_tip").translation, [pin_b[0], 0, pin_b[1]], atol=1e-15)


def test_four_bar_swings_and_comes_back():
    mech = mbdae.load("four_bar")
    q, _ = mech.start
    sol = mbdae.solve(mech, (0, 3.999368568), rtol=1e-10)
    np.testing.assert_allclose(sol.q[-1], q, atol=1e-6)
    np.testing.assert_allclose(sol.v[-1], 0, atol=1e-6)
    assert np.ptp(sol.q[:, 0]) > 5


# -- slider_crank --------------------------------------------------------------------------------------------------


def test_slider_crank_turns_for_five_seconds():
    mech = mbdae.load("slider_crank")
    sol = mbdae.solve(mech, (0, 5), rtol=1e-9)
    crank, pin_angle, slider = sol.q.T
    across = 0.1 * sin(crank)
    np.testing.assert_allclose(slider, 0.1 * cos(crank) + np.sqrt(0.35**2 - across**2), atol=1e-6)
    np.testing.assert_allclose(sin(crank + pin_angle), -across / 0.35, atol=1e-6)
    assert crank[-1] - crank[0] > 4 * 2 * np.pi
    speed = sol.v[:, 0]
    assert 3 < speed.min() < 4  # never stops, but far from uniform
    assert 7 < speed.max() < 8


# -- andrews_squeezer ----------------------------------------------------------------------------------------------

DATA = json.loads((Path(__file__).parents[1] / "data" / "andrews_squeezer.json").read_text())
P = SimpleNamespace(**DATA["parameters"])


def published_mass(q):
    _, T, _, F, _, W, _ = q
    k4, k6 = P.e - P.ea, P.zf - P.fa
    M = np.diag(
        [0.0, P.m2 * P.da**2 + P.i2, P.m3 * (P.sa**2 + P.sb**2) + P.i3, P.m4 * k4**2 + P.i4, 0, P.m6 * k6**2 + P.i6, 0]
    )
    M[0, 0] = P.m1 * P.ra**2 + P.m2 * (P.rr**2 - 2 * P.da * P.rr * cos(T) + P.da**2) + P.i1 + P.i2
    M[0, 1] = M[1, 0] = P.m2 * (P.da**2 - P.da * P.rr * cos(T)) + P.i2
    M[3, 4] = M[4, 3] = P.m4 * (k4**2 + P.zt * k4 * sin(F)) + P.i4
    M[4, 4] = P.m4 * (P.zt**2 + 2 * P.zt * k4 * sin(F) + k4**2) + P.m5 * (P.ta**2 + P.tb**2) + P.i4 + P.i5
    M[5, 6] = M[6, 5] = P.m6 * (k6**2 - P.u * k6 * sin(W)) + P.i6
    M[6, 6] = P.m6 * (k6**2 - 2 * P.u * k6 * sin(W) + P.u**2) + P.m7 * (P.ua**2 + P.ub**2) + P.i6 + P.i7
    return M


def published_force(q, v):
    _, T, c, F, _, W, _ = q
    db, dT, _, dF, dd, dW, de = v
    k4, k6 = P.e - P.ea, P.zf - P.fa
    arm = np.array([P.sd * cos(c) + P.sc * sin(c), P.sd * sin(c) - P.sc * cos(c)])  # from B to D
    spring = arm + [P.xb - P.xc, P.yb - P.yc]
    length = np.hypot(*spring)
    fx, fy = -P.c0 * (length - P.l0) / length * spring
    return np.array(
        [
            P.mom - P.m2 * P.da * P.rr * dT * (dT + 2 * db) * sin(T),
            P.m2 * P.da * P.rr * db**2 * sin(T),
            arm[0] * fy - arm[1] * fx,
            P.m4 * P.zt * k4 * dd**2 * cos(F),
            -P.m4 * P.zt * k4 * dF * (dF + 2 * dd) * cos(F),
            -P.m6 * P.u * k6 * de**2 * cos(W),
            P.m6 * P.u * k6 * dW * (dW + 2 * de) * cos(W),
        ]
    )


def published_constraints(q):
    b, T, c, F, d, W, e = q
    x, y = P.rr * cos(b) - P.d * cos(b + T), P.rr * sin(b) - P.d * sin(b + T)
    return np.array(
        [
            x - P.ss * sin(c) - P.xb,
            y + P.ss * cos(c) - P.yb,
            x - P.e * sin(F + d) - P.zt * cos(d) - P.xa,
            y + P.e * cos(F + d) - P.zt * sin(d) - P.ya,
            x - P.zf * cos(W + e) - P.u * sin(e) - P.xa,
            y - P.zf * sin(W + e) + P.u * cos(e) - P.ya,
        ]
    )


@pytest.fixture(scope="module")
def andrews():
    return mbdae.load("andrews_squeezer")


@pytest.fixture(scope="module")
def order(andrews):
    """Indices of the published coordinates in the model's: q[order] is published."""
    return np.array([andrews.joint_names.index(name) for name in DATA["coordinates"]])


def to_ours(order, values):
    out = np.empty(7)
    out[order] = values
    return out


def in_ground_axes(rows, q):
    """Rows (9,) rotated from the axes of K3, K4 and K6 into the ground's, (6,), and the out-of-plane ones, (3,)."""
    _, _, c, F, d, W, e = q
    turned = [
        (r[0] * cos(a) - r[1] * sin(a), r[0] * sin(a) + r[1] * cos(a))
        for a, r in zip([c, F + d, W + e], rows.reshape(3, 3), strict=True)
    ]
    return np.ravel(turned), rows[2::3]


@pytest.mark.parametrize("seed", range(5))
def test_andrews_mass_and_constraints(andrews, order, seed):
    q = np.random.default_rng(seed).uniform(-3, 3, 7)
    ours = to_ours(order, q)
    M = mass(andrews, ours)[np.ix_(order, order)]
    np.testing.assert_allclose(M, published_mass(q), atol=1e-14 * np.abs(M).max(), rtol=0)
    plane, across = in_ground_axes(andrews.residual(ours, np.zeros(7))[0], q)
    np.testing.assert_allclose(plane, published_constraints(q), atol=1e-15)
    np.testing.assert_allclose(across, 0, atol=1e-16)


@pytest.mark.parametrize("seed", range(5))
def test_andrews_forces(andrews, order, seed):
    q, v = np.random.default_rng(seed).uniform(-1, 1, (2, 7)) * [[3], [300]]
    ours = to_ours(order, q), to_ours(order, v)
    vdot, lam = accelerate(andrews, *ours)
    inertial, reaction = mass(andrews, ours[0]) @ vdot, jacobian(andrews, ours[0]).T @ lam
    scale = np.abs(inertial).max() + np.abs(reaction).max()
    np.testing.assert_allclose((inertial - reaction)[order], published_force(q, v), atol=1e-12 * scale, rtol=0)


def test_andrews_start(andrews, order):
    q, v = andrews.start
    start = {k: np.array(x) for k, x in DATA["start"].items()}
    np.testing.assert_allclose(q[order], start["q"], rtol=0, atol=1e-15)
    assert not v.any()
    vdot, lam = accelerate(andrews, q, v)
    np.testing.assert_allclose(vdot[order], start["a"], rtol=1e-11, atol=1e-7)
    plane, across = in_ground_axes(lam, start["q"])
    np.testing.assert_allclose(-plane, start["lambda"], rtol=1e-11, atol=1e-9)  # lam acts on the mechanism
    np.testing.assert_allclose(across, 0, atol=1e-9)


def test_andrews_end(andrews, order):
    end = {k: np.array(x) for k, x in DATA["end"].items()}
    sol = mbdae.solve(andrews, (0, 0.03), rtol=1e-11)
    np.testing.assert_allclose(sol.q[-1][order], end["q"], rtol=0, atol=2e-8)
    np.testing.assert_allclose(sol.v[-1][order], end["v"], rtol=0, atol=2e-5)
    plane, across = in_ground_axes(sol.lam[-1], end["q"])
    np.testing.assert_allclose(-plane, end["lambda"], rtol=0, atol=1e-4)
    np.testing.assert_allclose(across, 0, atol=1e-9)


def test_data_files_of_models_are_under_version_control():
    """Git ignores results of runs, *.npz, but not the data of models."""
    tables = {path: path.read_text("utf-8") for path in MODELS.glob("*/*.toml")}
    files = [path.parent / name for path, text in tables.items() for name in DATA_FILE.findall(text)]
    assert files
    for path in files:
        assert path.exists()
        assert subprocess.run(["git", "check-ignore", path.name], cwd=path.parent, capture_output=True).returncode
