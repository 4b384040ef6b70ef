"""One-sided derivatives at the bounds of parameters; fits and designs that end there."""

import numpy as np
import pytest

import mbdae
import mbdae.finite_differences as differences
from mbdae.errors import InputError
from mbdae.finite_differences import ABOVE, BELOW, STENCIL
from mbdae.mechanism.discrete_sensitivity.perturbed_mechanisms import TRIAL_POINTS, feasible_stencil
from mbdae.mechanism.formats.mechanism_file.template import Template

G, M = 9.81, 2.0
SLIDER = """
title = "Slider"
gravity = [0.0, 0.0, -9.81]
duration = 1.0

[[body]]
name = "slider"
parent = "world"
joint = "prismatic"
axis = [0.0, 0.0, 1.0]
mass = 2.0
com = [0.0, 0.0, 0.0]

[[force]]
name = "damper"
kind = "joint_damping"
joint = "slider"
damping = 0.0

[[frame]]
name = "high"
parent = "world"
xyz = [0.0, 0.0, 3.0]

[[force]]
name = "spring"
kind = "spring_damper"
frames = ["high", "slider"]
stiffness = 0.0
length = 0.0

[start]
v = {slider = 1.0}
"""
SAID = r"'force.\w+.\w+' = \S+ is at the end of its range: its derivative is taken from above"


@pytest.fixture
def path(tmp_path):
    (tmp_path / "slider.toml").write_text(SLIDER, "utf-8")
    return tmp_path / "slider.toml"


@pytest.mark.parametrize("places", TRIAL_POINTS)
def test_differences_are_of_order_six_on_either_side(places):
    """Exact for polynomials of degree six, and zero to the bit for constants."""
    for degree in range(7):
        exact = float(degree == 1)
        assert differences.central_difference({k: float(k) ** degree for k in places}, 1.0) == pytest.approx(
            exact, abs=1e-10
        )
    assert differences.central_difference(dict.fromkeys(places, 0.1), 1e-3) == 0.0
    found = [abs(differences.central_difference({k: np.exp(k * h) for k in places}, h) - 1) for h in (0.2, 0.1)]
    assert np.log2(found[0] / found[1]) == pytest.approx(6, abs=0.4)
    values = {k: np.sin(1 + 0.1 * k) for k in places}
    weights = differences.weights(places, 0.1)
    assert sum(w * values[k] for k, w in weights.items()) == pytest.approx(
        differences.central_difference(values, 0.1), abs=1e-13
    )


@pytest.mark.usefixtures("back_end")
def test_a_damping_of_zero_has_a_derivative(path):
    """m v' = -m g - c v from v0 = 1: dv/dc = -(t - g t^2/2)/m, dq/dc = -(t^2/2 - g t^3/6)/m at c = 0."""
    sol = mbdae.solve(path, (0, 1.0))
    with pytest.warns(UserWarning, match=SAID):
        found = mbdae.sensitivity(sol, ["force.damper.damping"])
    t = sol.t
    np.testing.assert_allclose(found.dy[:, 0, 0], -(t**2 / 2 - G * t**3 / 6) / M, atol=1e-9)
    np.testing.assert_allclose(found.dy[:, 1, 0], -(t - G * t**2 / 2) / M, atol=1e-9)
    with pytest.warns(UserWarning, match=SAID):
        last = mbdae.gradient(sol, lambda x: (x["q.slider"][-1], {"q.slider": np.eye(len(t))[-1]}),
                              {"force.damper.damping": 0.0})  # fmt: skip
    assert last.gradient["force.damper.damping"] == pytest.approx(-(1 / 2 - G / 6) / M, abs=1e-9)


@pytest.mark.usefixtures("back_end")
def test_a_rest_length_of_zero_has_a_derivative(path):
    """A spring from 3 m above: m q'' = k (3 - q - L) - m g, hence dq/dL = -(1 - cos wt), w^2 = k/m."""
    text = path.read_text("utf-8").replace("stiffness = 0.0", "stiffness = 50.0")
    path.write_text(text, "utf-8")
    sol = mbdae.solve(path, (0, 0.25), rtol=1e-10)
    with pytest.warns(UserWarning, match=SAID):
        found = mbdae.sensitivity(sol, ["force.spring.length"])
    np.testing.assert_allclose(found.dy[:, 0, 0], -(1 - np.cos(np.sqrt(50 / M) * sol.t)), atol=1e-8)


def test_a_number_bounded_above_has_its_derivative_from_below(path):
    """The same by a model of 1 - c, for c up to 1."""

    def model(kept):
        if kept > 1:
            raise ValueError("more than all")
        text = path.read_text("utf-8").replace("damping = 0.0", f"damping = {1.0 - kept}")
        path.with_name("kept.toml").write_text(text, "utf-8")
        return mbdae.load(path.with_name("kept.toml"))

    sol = mbdae.solve(model(1.0), (0, 1.0))
    with pytest.warns(UserWarning, match="'kept' = 1 is at the end of its range: its derivative is taken from below"):
        found = mbdae.sensitivity(sol, {"kept": 1.0}, model=model)
    assert found.dy[-1, 0, 0] == pytest.approx((1 / 2 - G / 6) / M, abs=1e-9)


def test_a_mass_of_zero_has_a_derivative():
    """Compared with runs of other masses, by a one-sided difference of order two of their ends."""
    name, h = "joint.crank.mass", 1e-4
    make = Template("four_bar").make
    ends = [mbdae.solve(make({name: k * h}), (0, 0.2), rtol=1e-12).q[-1] for k in range(3)]
    sol = mbdae.solve(make({name: 0.0}), (0, 0.2), rtol=1e-12)
    with pytest.warns(UserWarning, match="'joint.crank.mass' = 0 is at the end of its range"):
        found = mbdae.sensitivity(sol, {name: 0.0}, model="four_bar")
    quotient = (4 * ends[1] - ends[2] - 3 * ends[0]) / (2 * h)
    np.testing.assert_allclose(found.dy[-1, :3, 0], quotient, rtol=1e-5)


def test_what_can_be_moved_neither_way_is_rejected(path):
    def model(only):
        if only != 1:
            raise ValueError("one alone")
        return mbdae.load(path)

    sol = mbdae.solve(path, (0, 0.1))
    with pytest.raises(InputError, match="'only' = 1 cannot be changed by"):
        mbdae.sensitivity(sol, {"only": 1.0}, model=model)


@pytest.mark.filterwarnings("ignore:parameter .force.damper.damping.:UserWarning")
def test_a_fit_may_begin_and_end_at_the_end_of_a_range(path):
    """Measured free fall, fitted with damping: the minimum is at c = 0, also from there."""
    t = np.linspace(0, 1, 21)[1:]
    data = {"t": t, "q.slider": t - G * t**2 / 2 - 1e-3 * t}  # a little faster down than without damping
    for start in (0.3, 0.0):
        found = mbdae.fit(path, {"force.damper.damping": (start, 0.0, 1.0)}, data, sigma=1e-3)
        assert found.values["force.damper.damping"] == pytest.approx(0.0, abs=1e-6)
        assert found.at_bounds == ["force.damper.damping"]


@pytest.mark.filterwarnings("ignore:parameter .force.damper.damping.:UserWarning")
def test_a_design_may_begin_and_end_at_the_end_of_a_range(path):
    """Lowest after a second without damping, c = 0: the cost decreases to it, and its derivative is that of theory."""

    def low(signals):
        last = np.eye(len(signals["t"]))[-1]
        return signals["q.slider"][-1], {"q.slider": last}

    wide = ((start, bounds) for start in (0.3, 1e-3, 0.0) for bounds in ((0.0, 1.0), (None, 1.0), None))
    for start, bounds in wide:
        given = {} if bounds is None else {"bounds": {"force.damper.damping": bounds}}
        found = mbdae.optimize(path, low, {"force.damper.damping": start}, **given)
        assert found.bounds["force.damper.damping"] == (0.0, np.inf if bounds is None else 1.0)
        assert found.converged, found.message
        assert found.values["force.damper.damping"] == pytest.approx(0.0, abs=1e-12)
        assert found.cost == pytest.approx(1 - G / 2, abs=1e-7)
        assert found.gradient["force.damper.damping"] == pytest.approx(-(1 / 2 - G / 6) / M, abs=1e-6)


@pytest.mark.parametrize(("low", "high", "found"), [
    (-3.5, 9.0, (1.0, STENCIL)),
    (-9.0, 2.5, (1 / 8, STENCIL)),  # not all points on both sides at the full width
    (0.0, 9.0, (1.0, ABOVE)),
    (0.0, 2.5, (1 / 8, ABOVE)),
    (-9.0, 0.0, (1.0, BELOW)),
    (0.0, 0.0, (1.0, STENCIL)),  # on neither side: the error names the default width
])  # fmt: skip
def test_mechanisms_exist_at_all_points_of_a_width(low, high, found):
    def make(by):
        if not low <= by <= high:
            raise InputError("outside")
        return by

    assert feasible_stencil(make, 1.0) == found
    h, places = found
    assert all(low <= k * h <= high for k in places) == (low < high)


@pytest.mark.filterwarnings("ignore:parameter .force.damper.damping.:UserWarning")
def test_gradients_are_checked_at_the_end_of_a_range(path):
    """Tangents compared with quotients of runs, which have mechanisms on one side only."""
    study = mbdae.check_gradients(path, ["herk3"], parameter="force.damper.damping", T=0.5, steps=20)
    assert study.differences["herk3"] < 1e-9
    assert not study.refuted
