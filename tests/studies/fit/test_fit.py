"""Parameters from measurements: true values within standard deviations, false minima, unidentifiable ones, errors."""

import base64
import json
import re

import numpy as np
import pytest
from scipy.optimize import least_squares

import mbdae
from mbdae import tolerances
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.formats.model_library import find
from mbdae.studies.fit.data import read_recordings
from mbdae.studies.fit.fit import SPANS
from mbdae.studies.fit.fit_residuals import FitResiduals
from mbdae.studies.fit.identifiability import precision

COMMANDS = (
    "solve four_bar -t 0.4 --step 0.02 -o fit.csv",
    "fit four_bar fit.csv -p gravity.2=-12:-8 -s q.crank --step 0.02 -o fit.json --plot fit.svg --html fit.html",
)
COARSE = {"step": 0.1, "method": "herk3"}
STEP = {"step": 0.02, "method": "pherk5"}
CRANK = {"force.spring.stiffness": 80.0, "force.damper.damping": 0.02, "joint.slider.mass": 0.8}
FORCES = """
[[force]]
kind = "joint_spring"
name = "spring"
joint = "slider"
stiffness = 70.0
rest = 0.4
[[force]]
kind = "joint_damping"
name = "damper"
joint = "crank"
damping = 0.01
"""


def measured(model, values, times, names, **settings):
    sol = mbdae.solve(Template(str(model)).make(values), (0.0, times[-1]), t_eval=times, **settings)
    return {"t": times, **sol.signals(names)}


def crank(folder, more=""):
    """The slider-crank with a spring and a damper."""
    plain = find("slider_crank")
    text = plain.read_text().replace('"slider_crank.urdf"', f'"{plain.parent / "slider_crank.urdf"}"')
    path = folder / "crank.toml"
    path.write_text(text + FORCES + more)
    return path


def test_deviations_without_noise_levels_are_those_of_repeated_fits():
    """Each of two signals determines one parameter; their noise differs tenfold."""
    rng, signals = np.random.default_rng(3), np.repeat([0, 1], 30)
    J = rng.standard_normal((60, 2)) * np.where(signals[:, None] == [0, 1], 1.0, 0.1)
    noise = np.array([1.0, 10.0])[signals, None] * rng.standard_normal((60, 400))
    x = np.linalg.pinv(J) @ noise
    found = [precision(J, "ab", np.ones(2), np.full(2, 1e3), r, signals).covariance for r in (noise - J @ x).T]
    assert np.sqrt(np.mean(found, 0).diagonal()) == pytest.approx(x.std(1), rel=0.1)
    one = precision(J, "ab", np.ones(2), np.full(2, 1e3), r := noise[:, 0] - J @ x[:, 0], 0 * signals).covariance
    assert one == pytest.approx(np.linalg.inv(J.T @ J) * (r @ r) / 58, rel=1e-12)


def test_equal_weights_of_several_units_are_reported():
    """The noisier signal decides: 0.1 m/s with the weight of 0.1 mm, 1e6 times too large."""
    rng, times = np.random.default_rng(2), np.linspace(0.1, 1.0, 10)
    data = measured("pendulum", {"gravity.2": -10.0}, times, ["q.ball.x", "v.ball.x"], **COARSE)
    data["q.ball.x"] += 1e-4 * rng.standard_normal(10)
    data["v.ball.x"] += 0.1 * rng.standard_normal(10)
    levels = {"q.ball.x": 1e-4, "v.ball.x": 0.1}
    fits = [
        mbdae.fit("pendulum", {"gravity.2": (-12.0, -8.0)}, data, signals=names, sigma=sigma, spans=(1,), **COARSE)
        for names, sigma in (((), None), ((), levels), (["q.ball.x"], None))
    ]
    assert [sum("m and m/s have equal weights" in text for text in fit.warnings) for fit in fits] == [1, 0, 0]
    errors = [abs(fit.values["gravity.2"] + 10.0) for fit in fits]
    assert errors[0] > 3 * max(errors[1:])


def test_three_parameters_of_a_noisy_slider_crank(tmp_path):
    """Starts off by factors 0.5 to 2.5; noise of 0.1 mm."""
    path, times = crank(tmp_path), np.linspace(0.04, 2.0, 50)
    data = measured(path, CRANK, times, ["q.slider"], **STEP)
    data["q.slider"] += 1e-4 * np.random.default_rng(1).standard_normal(50)
    starts = {"force.spring.stiffness": (40.0, 10, 1000), "force.damper.damping": (0.05, 0, 1)}
    found = mbdae.fit(path, {**starts, "joint.slider.mass": (1.52, 0.1, 5)}, data, sigma=1e-4, **STEP)
    assert found.success, found
    assert found.runs < 60
    assert 0.5 < found.chi2 / found.dof < 1.6
    for name, value in CRANK.items():
        assert abs(found.values[name] - value) < 3.5 * found.deviations[name], (name, found)
    assert found.correlations[0, 2] > 0.9


@pytest.mark.slow
def test_eight_parameters_of_four_bar_from_clean_data():
    names = ["frame.coupler_tip.xyz.0", "frame.rocker_tip.xyz.0", "joint.rocker.xyz.0", "joint.coupler.mass",
             "joint.rocker.com.0", "gravity.2", "start.q.crank", "start.v.crank"]  # fmt: skip
    template = Template("four_bar")
    truth = {name: parameter_value(template, name) for name in names}
    truth["start.v.crank"] = 0.5
    data = measured("four_bar", truth, np.linspace(0.05, 0.8, 16), ["q.crank", "q.coupler", "q.rocker"], **STEP)
    bounds = {name: sorted((0.8 * x, 1.3 * x)) for name, x in truth.items()}
    given = {name: (1.02 * x, *bounds[name]) for name, x in truth.items()}
    found = mbdae.fit("four_bar", given, data, spans=(1.0,), **STEP)
    assert found.converged
    assert not found.at_bounds
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 1e-8 * abs(value), found


@pytest.mark.slow
def test_a_false_minimum_is_refuted():
    """Gravity from a bob that is out of phase by periods: fitting the whole span at once fails, growing spans do not.

    Other starts find the true value, too.
    """
    data = measured("pendulum", {"gravity.2": -9.81}, np.linspace(0.5, 5.0, 10), ["q.ball.x"], **COARSE)
    given = {"gravity.2": (-24.0, -30.0, -5.0)}
    whole = mbdae.fit("pendulum", given, data, sigma=1e-3, spans=(1.0,), **COARSE)
    assert whole.refuted
    assert not whole.success
    assert "not noise" in str(whole)
    growing = mbdae.fit("pendulum", given, data, sigma=1e-3, **COARSE)
    assert growing.success
    assert growing.values["gravity.2"] == pytest.approx(-9.81, abs=1e-6)
    several = mbdae.fit("pendulum", given, data, sigma=1e-3, spans=(1.0,), starts=2, seed=0, **COARSE)
    assert several.success
    assert several.searches[0].chi2 == whole.chi2 > 1e3 * several.chi2
    assert several.agreeing == 1
    assert "1 of 2 searches ended at this minimum" in str(several)


def test_unidentifiable_parameters_are_named(tmp_path):
    """Two parallel springs, and a spring that is never deflected."""
    path = crank(
        tmp_path, '[[force]]\nkind = "joint_spring"\nname = "other"\njoint = "slider"\nstiffness = 20\nrest = 0.4'
    )
    values = {"force.spring.stiffness": 60.0, "force.other.stiffness": 20.0}
    data = measured(path, values, np.linspace(0.1, 0.5, 5), ["q.slider"], **STEP)
    bounds = {name: (10, 200) for name in values}
    found = mbdae.fit(path, bounds, data, sigma=1e-4, spans=(1.0,), **STEP)
    assert found.unidentifiable == [("force.spring.stiffness", "force.other.stiffness")]
    assert not found.success
    assert np.isinf(found.deviations["force.other.stiffness"])
    np.testing.assert_array_equal(np.diag(found.covariance), np.inf)
    assert np.isnan(found.correlations).all()
    assert sum(found.values.values()) == pytest.approx(80.0, rel=1e-5)
    assert "only a combination of force.spring.stiffness, force.other.stiffness" in str(found)


def test_fewer_runs_than_with_quotients(tmp_path):
    """A run with derivatives counts as two."""
    path, times = crank(tmp_path), np.linspace(0.04, 0.6, 15)
    truth = {name: CRANK[name] for name in ("force.spring.stiffness", "joint.slider.mass")}
    data = measured(path, truth, times, ["q.slider"], **STEP)
    given = {"force.spring.stiffness": (40.0, 10, 1000), "joint.slider.mass": (1.5, 0.1, 5)}
    found = mbdae.fit(path, given, data, sigma=1e-4, **STEP)
    assert found.values == pytest.approx(truth, rel=1e-6)
    problem = FitResiduals(Template(str(path)), list(given), read_recordings(data), [{}], 1e-4, None, dict(STEP))
    x, low, high = np.array(list(given.values())).T
    for fraction in problem.span_fractions(SPANS, 2):
        problem.fraction, tolerance = fraction, tolerances.COARSE if fraction < 1 else tolerances.SEARCH_TOLERANCE
        x = least_squares(problem.residuals, x, "2-point", (low, high), x_scale=(high - low) / 10, ftol=tolerance,
                          xtol=tolerance, gtol=tolerance).x  # fmt: skip
    assert x == pytest.approx(list(truth.values()), rel=1e-3)
    assert found.runs + found.gradients < problem.runs


def test_several_runs_with_starts_of_their_own(tmp_path):
    known = [{"start.q.crank": 1.2}, {"start.q.crank": 0.9}]
    tables = [
        measured("four_bar", {**x, "gravity.2": -9.5}, np.linspace(0.1, 0.4, 4), ["q.crank"], **STEP) for x in known
    ]
    for i, table in enumerate(tables):
        np.savetxt(
            tmp_path / f"{i}.csv", np.column_stack(list(table.values())), delimiter=",", header="t,q.crank", comments=""
        )
    files = [str(tmp_path / f"{i}.csv") for i in range(2)]
    found = mbdae.fit(mbdae.load("four_bar"), {"gravity.2": (-12, -8)}, files, known=known, **STEP)
    assert found.values["gravity.2"] == pytest.approx(-9.5, abs=1e-7)
    found.save(tmp_path / "fit.json")
    assert json.loads((tmp_path / "fit.json").read_text())["values"] == found.values
    found.save(tmp_path / "fit.html")
    page = (tmp_path / "fit.html").read_text()
    assert page.count('<p class="caption">') == page.count("<table>") >= 1, "every table of numbers is numbered"
    for words in ("Fit of", "standard deviation", "gravity.2", "no warnings", "data:image/svg+xml"):
        assert words in page, words


def test_spans_without_enough_values_after_the_start_are_left_out():
    """Of six times, a sixth is the start alone, however many signals it has; missing values are no values."""
    times = np.linspace(0, 0.4, 6)
    data = measured(find("four_bar"), {}, times, ["q.crank", "v.crank", "q.rocker", "v.rocker"], **STEP)
    found = mbdae.fit("four_bar", {"gravity.2": (-12, -8)}, data, **STEP)
    assert found.values["gravity.2"] == pytest.approx(-9.81, abs=1e-6)
    late = {**data, **dict.fromkeys(data, np.r_[[np.nan] * 5, 1.0]), "t": times}
    problem = FitResiduals(Template(str(find("four_bar"))), ["gravity.2"], read_recordings(late), [{}], None, None, {})
    assert problem.span_fractions((0.5, 0.9), 1) == [1.0]


@pytest.mark.parametrize("runs", [[""], [", data 1", ", data 2"]])
def test_panels_of_the_page_say_signal_run_and_unit(runs, tmp_path):
    """From the figure inside the page, which has each text as a comment before its curves."""
    units = {"q.joint1": "rad", "force.joint1": "N"}
    data = [measured("double_pendulum", {}, np.linspace(0.1, 0.4, 4), units, **STEP) for _ in runs]
    mbdae.fit("double_pendulum", {"gravity.2": (-12, -8)}, data, spans=(1.0,), **STEP).save(tmp_path / "fit.html")
    (picture,) = re.findall(r"data:image/svg\+xml;base64,([^\"]+)", (tmp_path / "fit.html").read_text())
    said = re.findall(r"<!-- (.*?) -->", base64.b64decode(picture).decode())
    labels = [f"{name}{run} ({unit})" for run in runs for name, unit in units.items()]
    assert [text for text in said if text.startswith(tuple(units))] == labels
    assert said.count("residual / noise level") == len(labels)
    assert {"measured", "computed"} <= set(said)


def test_parquet(tmp_path):
    pytest.importorskip("pyarrow")
    import pyarrow.parquet

    data = measured("four_bar", {"gravity.2": -9.5}, np.linspace(0.1, 0.4, 4), ["q.crank"], **STEP)
    pyarrow.parquet.write_table(pyarrow.table(data), tmp_path / "data.parquet")
    found = mbdae.fit("four_bar", {"gravity.2": (-12, -8)}, tmp_path / "data.parquet", **STEP)
    assert found.values["gravity.2"] == pytest.approx(-9.5, abs=1e-7)


def test_one_measurement_of_two_parameters_has_no_chi_squared_per_degree_of_freedom():
    parameters = {"gravity.2": (-12, -8), "joint.crank.mass": (0.5, 2)}
    found = mbdae.fit("four_bar", parameters, {"t": [0.1], "q.crank": [1.2]}, **STEP)
    assert found.dof == -1
    assert np.isnan(found.reduced_chi2)
    assert re.search(r"chi\^2 / degrees of freedom = \S+ / -1\n", str(found))


DATA = {"t": [0.1, 0.2, 0.3], "q.crank": [1.2, 1.1, 1.0]}
WRONG = [
    ({"t_span": (0.0, 0.25)}, {}, InputError, r"data 1: t = 0\.3 s is outside the span, 0 to 0\.25 s"),
    ({"data": {**DATA, "t": [-0.1, 0.2, 0.3]}}, {}, InputError, "is outside the span"),
    ({"data": {"t": [0.1], "Gv": [0.0]}}, {}, InputError, "'Gv' has no gradient"),
    ({"data": {"t": [0.1], "q.nothing": [0.0]}}, {}, UnknownNameError, "nothing"),
    ({"data": {"q.crank": [0.0]}}, {}, InputError, "no column 't'"),
    ({"data": {"t": [0.2, 0.1], "q.crank": [0.0, 0.0]}}, {}, InputError, "times must increase"),
    ({"data": "nothing.csv"}, {}, InputError, r"nothing\.csv cannot be read"),
    ({"signals": ["q.slider"]}, {}, InputError, "no column 'q.slider'"),
    ({"sigma": {"q.slider": 1.0}}, {}, InputError, "noise level of 'q.crank'"),
    ({}, {"gravity.2": (-8, -12)}, InputError, r"'gravity\.2' takes \(low, high\)"),
    ({}, {"gravity.2": (-20, -12, -8)}, InputError, "outside its bounds"),
    ({}, {"gravity.x": (-12, -8)}, UnknownNameError, "gravity"),
    ({}, {"joint.rocker.rpy.0": (-1, 1)}, InputError, "violates redundant closures"),
    ({"known": [{}, {}]}, {}, InputError, "2 tables for 1 runs"),
    ({"spans": (2.0,)}, {}, InputError, "fractions of the samples"),
    ({"spans": 1.0}, {}, InputError, "fractions of the samples"),
    ({"starts": 0}, {}, InputError, "starts is a number of searches"),
    ({"seed": -1}, {}, InputError, "seed is a whole number, at least 0, got -1"),
    ({"data": {**DATA, "q.crank": [1.2, np.inf, 1.0]}}, {}, InputError, "'q.crank' has an infinite value"),
    ({"sigma": "x"}, {}, InputError, "noise level of 'q.crank'"),
    ({"known": {"gravity.2": -9.0}}, {}, InputError, "'gravity.2' is both known and to be identified"),
    ({"known": 3}, {}, InputError, "tables, name = value, got 3"),
    ({"scales": {"gravity.1": 1.0}}, {}, UnknownNameError, r"parameter 'gravity\.1'"),
    ({"scales": {"gravity.2": "x"}}, {}, InputError, r"scale of parameter 'gravity\.2' is a positive number, got 'x'"),
    ({"t_span": "3 s"}, {}, InputError, "t_span is an end, or a start and an end in s, got '3 s'"),
    ({"events": "q.crank"}, {}, InputError, "a fit takes no events"),
    ({}, ["gravity.2"], InputError, "a fit needs parameters"),
]


@pytest.mark.parametrize(("options", "parameters", "error", "words"), WRONG)
def test_what_is_wrong_is_said_by_name(options, parameters, error, words):
    arguments = {"data": DATA, **STEP, **options}
    with pytest.raises(error, match=words):
        mbdae.fit("four_bar", parameters or {"gravity.2": (-12, -8)}, arguments.pop("data"), **arguments)
