"""Tolerances and clearances: against closed forms, differences of assembly and samples."""

import json

import numpy as np
import pytest

import mbdae
from mbdae import kinematics, tolerance
from mbdae.finite_differences import numerical_derivative
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.tree.frames import frame_paths
from mbdae.solution.signal_value import signal_values

COMMANDS = (
    "tolerance slider_crank --drive crank --points 9 -s position.slider_pin.x"
    " -p frame.rod_tip.xyz.0=5e-5 --clearance 'wrist pin=2e-5'",
)
CRANK, ROD, RAIL = "joint.crank_pin.xyz.0", "frame.rod_tip.xyz.0", "joint.slider.xyz.2"
DIMENSIONS = {CRANK: 0.15, ROD: 0.30, RAIL: 0.0}
X = "position.slider_pin.x"


def slider(theta, crank, rod, e):
    """Position of the slider on a rail at the height e."""
    return crank * np.cos(theta) + np.sqrt(rod**2 - (crank * np.sin(theta) - e) ** 2)


def slider_derivatives(theta):
    """Derivatives of the position by crank, rod and e at e = 0."""
    crank, rod, _ = DIMENSIONS.values()
    root = np.sqrt(rod**2 - (crank * np.sin(theta)) ** 2)
    return np.array([np.cos(theta) - crank * np.sin(theta) ** 2 / root, rod / root, crank * np.sin(theta) / root])


@pytest.fixture(scope="module")
def slider_crank():
    """From 0.7 to 2.5 rad, standard deviations of 2 mm each, clearance 0.1 mm."""
    sizes = dict.fromkeys(DIMENSIONS, 2e-3)
    return tolerance("slider_crank", "crank", [X], sizes, {"wrist pin": 1e-4, "crank_pin": 1e-4}, span=(0.7, 2.5),
                     points=4, sigmas=1, second_order=True, values=DIMENSIONS)  # fmt: skip


def test_slider_crank_is_the_closed_form(slider_crank):
    u, found = slider_crank.curve.u, slider_crank.influences
    np.testing.assert_allclose(found.derivatives[0], slider_derivatives(u).T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.derivatives[0, 0], [0.5456516992, 1.0562978863, 0.3402428907], rtol=0, atol=1e-10)
    expected = slider_derivatives(u)[1][:, None] * [1, 1]
    np.testing.assert_allclose(slider_crank.magnitudes[0, :, 3:], expected, atol=1e-12)
    assert slider_crank.magnitudes[0, 0, 3] * 1e-4 == pytest.approx(0.105630e-3, abs=5e-10)
    np.testing.assert_array_equal(found.directions, 2)  # none out of the plane, where the pin's row is redundant
    worst = 2e-3 * np.abs(slider_derivatives(u)).sum(axis=0) + 2e-4 * slider_derivatives(u)[1]
    np.testing.assert_allclose(slider_crank.worst[0], worst, rtol=1e-12)


def test_second_derivatives_are_those_of_the_closed_form():
    """Exact first derivatives by complex steps, and their differences of sixth order."""
    sizes = dict.fromkeys(DIMENSIONS, 3e-5)
    found = tolerance(
        "slider_crank", "crank", [X], sizes, span=(0.7, 2.5), points=2, second_order=True, values=DIMENSIONS
    )

    def derivatives(change):
        values = np.array([*DIMENSIONS.values()]) + change
        return np.array([slider(found.curve.u, *(values + 1e-30j * e)).imag / 1e-30 for e in np.eye(3)])

    H = np.array([numerical_derivative(lambda x, e=e: derivatives(x * e), 1e-3) for e in np.eye(3)])
    np.testing.assert_allclose(found.hessians[0], H.transpose(2, 0, 1), rtol=0, atol=1e-7 * np.abs(H).max())


def test_moments_are_those_of_a_large_sample(slider_crank):
    """2.5 rad, three dimensions, normally distributed, and two pins in contact in a random direction."""
    n, rng, at = 100_000, np.random.default_rng(1), -1
    crank, rod, e = (x + 2e-3 * rng.standard_normal(n) for x in DIMENSIONS.values())
    nominal = slider(2.5, *DIMENSIONS.values())
    exact = slider(2.5, crank, rod, e) - nominal
    assert np.mean(exact) == pytest.approx(slider_crank.mean_shift[0, at], abs=3 * exact.std() / np.sqrt(n))
    assert slider_crank.mean_shift[0, at] == pytest.approx(-1.111e-5, abs=5e-9)
    end = crank * np.exp(2.5j) + 1e-4 * np.exp(2j * np.pi * rng.random((2, n))).sum(axis=0)
    exact = end.real + np.sqrt(rod**2 - (end.imag - e) ** 2) - nominal
    error = exact.std() / np.sqrt(2 * n)
    assert exact.std() == pytest.approx(slider_crank.second_order_deviation[0, at], abs=3 * error)
    assert slider_crank.second_order_deviation[0, at] > slider_crank.deviation[0, at]


def freudenstein(theta, psi, a, b, c, d):
    """Derivatives of the rocker's angle by crank a, coupler b, rocker c and ground d, from Freudenstein's equation.

    a^2 - b^2 + c^2 + d^2 - 2 a c cos(theta - psi) - 2 a d cos theta + 2 c d cos psi = 0
    """
    by_psi = -2 * a * c * np.sin(theta - psi) - 2 * c * d * np.sin(psi)
    by_lengths = [
        2 * a - 2 * c * np.cos(theta - psi) - 2 * d * np.cos(theta),
        -2 * b + 0 * theta,
        2 * c - 2 * a * np.cos(theta - psi) + 2 * d * np.cos(psi),
        2 * d - 2 * a * np.cos(theta) + 2 * c * np.cos(psi),
    ]
    return -np.array(by_lengths) / by_psi


BARS = {"joint.coupler.xyz.0": 1e-4, "frame.coupler_tip.xyz.0": 2e-4, "frame.rocker_tip.xyz.0": 3e-4,
        "joint.rocker.xyz.0": 4e-4}  # fmt: skip


@pytest.fixture(scope="module")
def bars():
    signals = ["q.rocker", "position.coupler_tip.x", "position.coupler_tip.z"]
    return tolerance("four_bar", "crank", signals, BARS, {"pin": 1e-4}, points=13)


def test_four_bar_follows_freudenstein(bars):
    lengths = mbdae.load("four_bar").model
    assert lengths.jointPlacements[2].translation[0] == 1.0
    found = bars.influences
    expected = freudenstein(bars.curve.u, found.values[0], 1.0, 2.0, 1.5, 2.0)
    np.testing.assert_allclose(found.derivatives[0], expected.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(bars.magnitudes[0, :, 4], np.abs(expected[1]), rtol=0, atol=1e-12)  # as the coupler


def test_bands_contain_all_vertices_of_the_tolerances(bars):
    """The largest displacement across the path over all 2^4 extreme four-bars, at equal cranks."""
    small = tolerance("four_bar", "crank", list(bars.signals), {n: 1e-2 * t for n, t in BARS.items()}, points=13)
    worst, statistical, normals = small.band("coupler_tip")
    template, across = Template("four_bar"), []
    for signs in np.ndindex(2, 2, 2, 2):
        values = [1.0, 2.0, 1.5, 2.0] + (2 * np.array(signs) - 1) * [*small.tolerances.values()]
        mech = template.make(dict(zip(BARS, values.tolist(), strict=True)))
        other = kinematics(mech, "crank", span=(small.curve.u[0], small.curve.u[-1]), points=13)
        moved = other.frames(["coupler_tip"])[0][0] - small.curve.frames(["coupler_tip"])[0][0]
        across.append((moved[:, [0, 2]] * normals).sum(axis=1))
    np.testing.assert_allclose(np.max(across, axis=0), worst, rtol=2e-4)
    assert (statistical < worst).all()
    assert small.paths() == ["coupler_tip"]


def differences(model, signals, names, q):
    """Derivatives of signals with respect to parameters, from sixth-order differences of assembled poses, (m, k)."""
    template = Template(model)

    def pose(name, x):
        mech = template.make({name: parameter_value(template, name) + x})
        at, known = mech.assemble(q=q)[0], signal_values(mech)
        frames = [n.split(".") for n in signals if n.startswith("position.")]
        paths = [frame_paths(mech.model, [frame], at[None])[0, 0, "xyz".index(axis)] for _, frame, axis in frames]
        return np.array([at[known[n].i] for n in signals if n.startswith("q.")] + paths)

    return np.stack([numerical_derivative(lambda x, n=n: pose(n, x), 2e-3) for n in names], axis=-1)


PISTONS = {f"piston_{i}": 0.02 * i for i in range(1, 7)}
CASES = {  # drive, signals, parameters, input, locked joints, closure and joint with clearance, positions of both
    "spatial_slider_crank": (
        "crank", ["q.slider", "position.rod_end.y"],
        [*(f"frame.crank_pin.xyz.{i}" for i in range(3)), *(f"body.crank.xyz.{i}" for i in range(3)),
         "body.crank.rpy.1", "frame.rod_end.xyz.2"],
        0.7, {}, ("ball joint", "crank"),
    ),
    "stewart_platform": (
        "piston_1", ["q.leg_5.1", "position.platform.x", "position.platform.z"],
        [*(f"frame.socket_4.xyz.{i}" for i in range(3)), *(f"body.leg_3.xyz.{i}" for i in range(3))],
        0.02, {n: x for n, x in PISTONS.items() if n != "piston_1"}, ("ball joint 4", "leg_3"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("model", CASES)
def test_loops_in_space_agree_with_differences_of_assembly(model):
    """A clearance is the gradient by the position of the joint, or of one of the closure's frames."""
    drive, signals, names, u, hold, pins = CASES[model]
    found = tolerance(model, drive, signals, dict.fromkeys(names, 1e-4), dict.fromkeys(pins, 1e-5),
                      span=(u, u + 1e-3), points=2, hold=hold)  # fmt: skip
    expected = differences(model, signals, names, {drive: u, **hold})
    tolerances = {"rtol": 0, "atol": 1e-9 * np.abs(expected).max()}
    np.testing.assert_allclose(found.influences.derivatives[:, 0], expected, **tolerances)
    for pin, columns in ((-2, expected[:, :3]), (-1, expected[:, 3:6])):
        np.testing.assert_allclose(found.magnitudes[:, 0, pin], np.linalg.norm(columns, axis=1), **tolerances)
    np.testing.assert_array_equal(found.influences.directions, 3)


@pytest.mark.slow
def test_close_to_dead_points_it_says_so():
    """Driven by its slider, the crank is dead where crank and rod are in line: there a short rod does not reach."""
    crank, rod, t = 0.1, 0.35, 1e-3
    for distance in (0.5, 0.9, 1.1, 2.0, 20.0):
        x = crank + rod - distance * t
        settings = {"span": (x, x - 1e-4), "points": 2}
        found = tolerance("slider_crank", "slider", ["q.crank"], {ROD: t}, **settings)
        assert (found.nonlinearity[0] > 0.25) == (distance < 1)
        few = tolerance("slider_crank", "slider", ["q.crank"], {ROD: 0.01 * t}, **settings)
        angle, moved = (np.arccos((crank**2 + x**2 - b**2) / (2 * crank * x)) for b in (rod, rod - 0.01 * t))
        missed = abs(abs(moved - angle) / few.worst[0, 0] - 1)
        assert few.nonlinearity[0] == pytest.approx(missed, rel=0.1)
    whole = tolerance("slider_crank", "slider", ["q.crank"], {ROD: t})
    dead = ~whole.curve.moving
    assert dead.sum() == 2
    assert np.isnan(whole.worst[0, dead]).all()
    assert np.isfinite(whole.worst[0, ~dead]).all()
    lines = str(whole).splitlines()
    assert any("dead points of the input joint at 0.45, 0.25: influences grow without bound" in line for line in lines)
    assert any("may not assemble at this input with all dimensions within tolerance" in line for line in lines)
    assert np.nanmax(whole.influences.condition) > 20


def test_rates_and_holding_efforts():
    settings = {"span": (0.4, 2.0), "points": 3}
    found = tolerance(
        "slider_crank", "crank", ["v.slider", "holding"], {ROD: 1e-4, "joint.crank_pin.mass": 1e-3}, **settings
    )
    assert found.units == {"v.slider": "m/rad", "holding": "N m"}
    template = Template("slider_crank")

    def changed(x):
        return kinematics(template.make({ROD: 0.35 + x}), "crank", **settings)

    def effort(x):
        curve = changed(x)
        system = curve.mechanism.system()
        forces = [system.force(0.0, q, np.zeros(3), np.zeros(0))[0] for q in curve.q]
        return -(np.array(forces) * curve.rates).sum(axis=1)

    expected = numerical_derivative(lambda x: changed(x).ratio("slider"), 1e-3)
    np.testing.assert_allclose(found.influences.derivatives[0, :, 0], expected, rtol=1e-9)
    np.testing.assert_allclose(found.influences.derivatives[1, :, 0], numerical_derivative(effort, 1e-3), rtol=1e-9)


def test_tables_and_figure(bars, slider_crank, tmp_path):
    rows = bars.contributions("q.rocker")
    assert [x.worst for x in rows] == sorted((x.worst for x in rows), reverse=True)
    assert sum(x.share for x in rows) == pytest.approx(1)
    assert sum(x.variance_share for x in rows) == pytest.approx(1)
    assert {x.name for x in rows} == {*BARS, "pin"}
    i = bars.worst_pose("q.rocker")
    assert sum(x.worst for x in rows) == pytest.approx(bars.worst[0].max(), rel=1e-14)
    assert bars.statistical[0, i] == pytest.approx(np.sqrt(sum(x.worst**2 for x in rows)), rel=1e-14)
    columns = slider_crank.to_columns()
    assert {len(x) for x in columns.values.values()} == {4}
    np.testing.assert_array_equal(columns.values[f"mean_shift.{X}"], slider_crank.mean_shift[0])
    for name in ("out.csv", "out.json", "out.tex"):
        bars.save(tmp_path / name)
    assert json.loads((tmp_path / "out.json").read_text())["contributions"]["q.rocker"][0]["name"] == rows[0].name
    axes = bars.plot(tmp_path / "out.png").axes
    assert [ax.get_ylabel() for ax in axes] == [
        *(f"{n}\n({bars.units[n]})" for n in bars.signals),
        f"{bars.signals[2]} (m)",
    ]
    assert "second_order" not in str(bars)
    assert f"mean {slider_crank.mean_shift[0, slider_crank.worst_pose(X)]:+.3g} m" in str(slider_crank)
