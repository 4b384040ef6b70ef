"""Models with known answers: published problems, Jansen's walker, and a mechanism without closures."""

import cmath
import json

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from commands import sample_commands, without_layout, without_pictures
from scipy.integrate import solve_ivp
from test_examples import example

import mbdae
from mbdae.__main__ import cli

DIGITS = example("digits")

# -- the page of digits ----------------------------------------------------------------------------------------------

PAGE = DIGITS.PAGE.read_text().split("| problem |")[1].split("\n\n")[0].splitlines()[2:]
ROWS = [[cell.strip() for cell in row.strip("|").split("|")] for row in PAGE]
AT = {row[0]: i for i, row in enumerate(ROWS) if row[0]}  # start of each problem


def test_every_problem_is_on_the_page():
    assert list(AT) == [p.__doc__.rstrip(".") for p in DIGITS.PROBLEMS.values()]


@pytest.mark.parametrize("name", DIGITS.PROBLEMS)
def test_digits(name):
    """The references are those of the page, and errors are no more than three times those of the page."""
    found = DIGITS.main([name])[name]
    at = AT[DIGITS.PROBLEMS[name].__doc__.rstrip(".")]
    for digits, (_, what, reference, error) in zip(found, ROWS[at : at + len(found)], strict=True):
        assert (digits.what, digits.reference) == (what, reference)
        assert digits.error <= 3 * float(error) + DIGITS.ROUNDING


@pytest.mark.parametrize("N", [1, 10])
def test_a02_stays_on_the_parallelogram_branch(N):
    cranks, energy, passed = DIGITS.four_bars(N)
    assert cranks.error < 1e-9
    assert energy.error < 1e-6
    assert passed.error == 0


def test_a02_moves_like_one_crank():
    """All cranks as one: J a'' = w g cos a, with J = (N + 1)/3 + N and w = (N + 1)/2 + N, in kg m^2 and kg m."""
    N = 10
    ratio = 9.81 * ((N + 1) / 2 + N) / ((N + 1) / 3 + N)
    plain = solve_ivp(
        lambda t, y: [y[1], -ratio * np.cos(y[0])], (0, 3), [np.pi / 2, -1.0], method="DOP853", rtol=1e-12, atol=1e-12
    )
    sol = mbdae.solve(mbdae.load("n_four_bar", N=N), (0, 3), rtol=1e-9, project=True)
    crank = sol.mechanism.joint_names.index("crank_0")
    np.testing.assert_allclose(sol.q[-1, crank], plain.y[0, -1], atol=1e-7)
    np.testing.assert_allclose(sol.v[-1, crank], plain.y[1, -1], atol=1e-7)


def test_bricard_has_one_degree_of_freedom():
    assert mbdae.info(mbdae.load("bricard")).dof == 1


def test_bricard_moves_as_known():
    """Alternate angles of the orthogonal linkage satisfy cos a + cos b + cos a cos b = 0, a and b from folded flat."""
    sol = mbdae.solve(mbdae.load("bricard"), (0, 4), rtol=1e-9)
    one, two, three, four, five = sol.q.T
    np.testing.assert_allclose([three, five], [one, -one], atol=1e-7)
    np.testing.assert_allclose(four, -two, atol=1e-7)
    np.testing.assert_allclose(np.sin(one) - np.sin(two) - np.sin(one) * np.sin(two), 0, atol=1e-7)
    assert np.ptp(one) > 2


# -- Jansen's walker -------------------------------------------------------------------------------------------------


def cross(p, r, q, s, side):
    """Intersections of circles about p and q, in the complex plane; side +1: to the left of the line from p to q."""
    d = abs(q - p)
    x = (r * r - s * s + d * d) / (2 * d)
    return p + (q - p) / d * complex(x, side * np.sqrt(r * r - x * x))


def points(crank, side):
    """Upper and lower pin, wing, knee and foot in m, from the published lengths; side -1: the mirrored leg."""
    pin_, hip = 0.15 * cmath.exp(1j * crank), complex(-side * 0.38, -0.078)
    upper = cross(hip, 0.415, pin_, 0.5, side)
    lower = cross(hip, 0.393, pin_, 0.619, -side)
    wing = cross(hip, 0.401, upper, 0.558, side)
    knee = cross(lower, 0.367, wing, 0.394, side)
    return {
        "thigh_top": upper,
        "arm_tip": lower,
        "hanger": wing,
        "knee": knee,
        "foot": cross(lower, 0.49, knee, 0.657, side),
    }


def test_jansen_walks_as_published():
    mech = mbdae.load("jansen_walker", legs=4)
    sol = mbdae.solve(mech, (0, 3.2), rtol=1e-8, project=True)
    data = mech.model.createData()
    paths = []
    for t, q in zip(sol.t, sol.q, strict=True):
        pin.framesForwardKinematics(mech.model, data, q)
        for n, (side, phase) in enumerate([(1, 0), (-1, 0), (1, np.pi), (-1, np.pi)]):
            expected = points(2.0 * t + phase, side)
            for name, z in expected.items():
                found = data.oMf[mech.model.getFrameId(f"{name}_{n}")].translation
                np.testing.assert_allclose(found, [z.real, 0.1 * n, z.imag], atol=1e-9)
        paths.append(points(2.0 * t, 1)["foot"])
    path = np.array(paths)
    low = path.imag < path.imag.min() + 0.02
    assert np.ptp(path[low].real) > 0.5  # a flat sole: half a metre within two centimetres
    assert np.ptp(path.imag) > 0.15


@pytest.mark.parametrize("legs", range(1, 9))
def test_jansen_is_driven(legs):
    mech = mbdae.load("jansen_walker", legs=legs)
    card = mbdae.info(mech)
    assert (card.nv, card.ng, card.dof) == (6 * legs + 1, 9 * legs + 1, 0)
    assert card.g_loaded < 1e-12
    mass = sum(mech.model.inertias[i].mass for i in range(1, mech.model.njoints))
    assert mass == pytest.approx(
        2 + legs * 0.25 * (0.415 + 0.401 + 0.558 + 0.393 + 0.5 + 0.619 + 0.394 + 0.367 + 0.49 + 0.657)
    )


def test_jansen_with_eight_legs():
    """The run of 60 s of the model's page, shortened."""
    sol = mbdae.solve(mbdae.load("jansen_walker"), (0, 2.5), rtol=1e-9, project=True)
    found = mbdae.drift(sol)
    assert found.g_max < 1e-9
    assert found.energy_relative < 1e-6
    assert np.ptp(sol.work) > 0.05
    effort = sol.effort("crank driver")
    work = np.concatenate([[0], np.cumsum(np.diff(sol.t) * (effort.power[1:] + effort.power[:-1]) / 2)])
    np.testing.assert_allclose(sol.work, work, atol=2e-3 * np.ptp(work))


# -- no closure ------------------------------------------------------------------------------------------------------


def test_double_pendulum_against_its_equation():
    """The planar double pendulum about x, from Lagrange's equations, with the numbers of the file."""
    m1, m2, I1, I2 = 0.26703, 0.33238, 0.00040827, 0.0011753
    (y1, z1), z2, length = (2.1727e-06, 0.036012), 0.10088, 0.1
    y2 = 1.9371e-10

    def rate(t, s):
        a, b = s[0], s[0] + s[1]
        ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
        r1 = np.array([y1 * ca - z1 * sa, y1 * sa + z1 * ca])  # (y, z), rotated by a about x
        r2 = np.array([y2 * cb - z2 * sb, y2 * sb + z2 * cb])
        arm = length * np.array([-sa, ca])
        turn = np.array([[0, -1], [1, 0]])
        J1 = np.column_stack([turn @ r1, [0, 0]])
        J2 = np.column_stack([turn @ (arm + r2), turn @ r2])
        M = m1 * J1.T @ J1 + m2 * J2.T @ J2 + np.array([[I1 + I2, I2], [I2, I2]])
        da, db = s[2], s[2] + s[3]
        drift = -J1.T @ (m1 * da**2 * -r1) - J2.T @ (m2 * (-arm * da**2 - r2 * db**2))
        weight = -9.81 * (m1 * J1[1] + m2 * J2[1])
        return np.concatenate([s[2:], np.linalg.solve(M, drift + weight)])

    sol = mbdae.solve(mbdae.load("double_pendulum"), (0, 1), rtol=1e-10)
    plain = solve_ivp(rate, (0, 1), [2.2, -0.6, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(np.concatenate([sol.q[-1], sol.v[-1]]), plain.y[:, -1], atol=1e-5)


COMMANDS = [
    "info double_pendulum",
    "solve double_pendulum -t 0.3 -o run.npz --html run.html --plot run.png",
    "solve double_pendulum -t 0.3 --project -o run.csv",
    "solve double_pendulum -t 0.3 --formulation ggl",
    "solve double_pendulum -t 0.3 -m radau5",
    "solve double_pendulum -t 0.3 --formulation index1 -m DOP853",
    "drift run.npz --max 1e-5 --plot drift.png",
    "order double_pendulum -m herk2 -t 0.1 --steps 10 --plot order.png",
    "check-gradients double_pendulum -m herk2 -t 0.1",
    "compare double_pendulum -t 0.2 -m pherk5 -m ggl:herk3 --rtol 1e-4,1e-6 --repeats 1 -o c.csv --plot c.png",
    "animate run.npz -o again.html",
    "report double_pendulum -t 0.2 -m pherk5 --repeats 1 -o report.html",
    "sweep sweep.toml -o sweep.parquet",
]


@pytest.mark.slow
def test_a_mechanism_without_closures_runs_through_every_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    without_layout(monkeypatch)
    (tmp_path / "sweep.toml").write_text('model = "double_pendulum"\nend = 0.1\n[grid]\nsolve.rtol = [1e-3, 1e-6]\n')
    every = [*COMMANDS, *sample_commands()]
    for command in [*COMMANDS, *(c for c in sample_commands() if "run.npz" in c)]:  # other commands name a model
        result = CliRunner().invoke(cli, [*command.split(), "--json"])
        assert result.exit_code == 0, (command, result.output, result.exception)
        json.loads(result.stdout)
    assert {command.split()[0] for command in every} | {"models", "methods"} == set(cli.commands)
