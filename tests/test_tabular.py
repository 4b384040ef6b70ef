"""Displays and tables of results: notebooks, files for other programs, pandas, xarray and LaTeX."""

import csv
import json
import re
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import mbdae
from mbdae.errors import InputError
from mbdae.tabular import Tabular, latex, table, write_csv


@pytest.fixture(scope="module")
def mech():
    return mbdae.load("four_bar")


@pytest.fixture(scope="module")
def sol(mech):
    return mbdae.solve(mech, (0, 0.2), rtol=1e-6)


@pytest.fixture(scope="module")
def results(mech, sol):
    spring = mbdae.load("spring_four_bar")
    return {
        "solution": sol,
        "drift": mbdae.drift(sol),
        "card": mbdae.info(mech),
        "order": mbdae.order(mech, ["herk3"]),
        "comparison": mbdae.compare(mech, (0, 0.2), methods=["herk3", "pherk5"], rtol=[1e-4, 1e-6], repeats=0),
        "sweep": mbdae.sweep(
            "four_bar", {"solve.rtol": [1e-5, 1e-7]}, 0.1, outputs=["peak v.crank", "q.crank"], times=3,
            executor="threads",
        ),
        "kinematics": mbdae.kinematics(mbdae.load("slider_crank"), "crank", points=12),
        "inverse": mbdae.inverse_dynamics(mech, sol, ["crank"]),
        "statics": mbdae.equilibrium(spring),
        "modes": mbdae.modes(spring),
        "linear": mbdae.linearize(spring, inputs=["left"], outputs=["q.left"]),
    }


DRAWN = ("solution", "drift", "order", "comparison", "sweep", "kinematics", "inverse", "modes")
TABLED = (*DRAWN, "linear")
NAMES = (*TABLED, "card", "statics")


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_shows_it(results, name):
    page = results[name]._repr_html_()
    assert isinstance(results[name], Tabular)
    assert page.startswith("<iframe" if name == "solution" else "<div><strong>")
    assert page.count("<td") == page.count("</td>")
    assert str(results[name]).strip()


def test_text_is_aligned_left_and_numbers_right():
    left = ' style="text-align: left"'
    page = table([["name", "x"], ["a < b", "-1.5"]])
    assert f"<tr><th{left}>name</th><th>x</th></tr><tr><td{left}>a &lt; b</td><td>-1.5</td></tr>" in page


def test_a_mechanism_shows_its_card(mech):
    page = mech._repr_html_()
    assert "degrees of freedom: 1" in page
    assert page.count(mech.title) == 1
    assert repr(mech) == f"<Mechanism {mech.title}: nq {mech.nq}, nv {mech.nv}, {mech.ng} closure rows>"


@pytest.mark.parametrize("name", TABLED)
def test_tables_are_read_without_arguments(results, name, tmp_path):
    pandas = pytest.importorskip("pandas")
    found = results[name].to_columns()
    results[name].save(tmp_path / "a.csv")
    table = pandas.read_csv(tmp_path / "a.csv")
    frame = results[name].to_pandas()
    assert frame.attrs["units"] == dict(found.units)
    assert len(table) == len(frame) == len(next(iter(found.values.values())))
    with (tmp_path / "a.csv").open() as file:
        assert next(csv.reader(file)) == list(table.columns)
    for column in set(table.columns) & set(frame.columns):
        if pandas.api.types.is_float_dtype(frame[column]):
            np.testing.assert_allclose(table[column].astype(float), frame[column], rtol=1e-14)


@pytest.mark.parametrize("name", TABLED)
def test_arrays_have_units(results, name):
    pytest.importorskip("xarray")
    found, data = results[name].to_columns(), results[name].to_xarray()
    for column, unit in found.units.items():
        assert (data[column].attrs["units"] if column in data.data_vars else unit) == unit
    assert (found.over or "row") in data.dims


@pytest.mark.parametrize("name", ["drift", "card", "order", "comparison", "sweep", "inverse", "modes"])
def test_latex_has_whole_rows(results, name, tmp_path):
    text = results[name].to_latex()
    for found in re.findall(r"\\begin\{tabular\}\{(l*r*)\}(.*?)\\end\{tabular\}", text, re.S):
        rows = [line for line in found[1].splitlines() if line.endswith(r"\\")]
        assert len(rows) > 1
        assert {len(re.findall(r"(?<!\\)&", row)) for row in rows} == {len(found[0]) - 1}
    assert text.count("{") == text.count("}")
    assert text.count(r"\begin{tabular}") == (2 if name == "order" else 1)
    results[name].save(tmp_path / "a.tex")
    assert (tmp_path / "a.tex").read_text() == text


def test_cells_of_latex():
    row = latex([["a_b", "50 %"], ["<1.2e-05", "x & |y|"]], "title").splitlines()
    assert r"a\_b & 50 \% \\" in row
    assert r"$<1.2 \times 10^{-5}$ & x \& $|$y$|$ \\" in row


def test_rates_of_convergence(results):
    study = results["order"]
    slope = study.orders["herk3"][0]
    expected = [np.log2(a / b) for a, b in zip(slope.errors, slope.errors[1:], strict=False)]
    assert slope.rates[1:] == pytest.approx(expected)
    headers, units, *rows = study.convergence("herk3")
    assert headers[:3] == ["herk3", "error q", "rate"]
    assert units[:4] == ["", "rad", "", "rad/s"]
    sizes = [study.T / n for n in slope.steps]
    assert [float(row[0].removeprefix("h = ").removesuffix(" s")) for row in rows] == pytest.approx(sizes, rel=1e-3)
    assert rows[2][2] == f"{expected[1]:.2f}"
    assert f"{slope.errors[0]:.2e}" in str(study)


@pytest.mark.parametrize("name", DRAWN)
def test_plots_are_figures(results, name, tmp_path):
    figure = results[name].plot()
    assert isinstance(figure, Figure)
    assert figure._repr_svg_().startswith("<?xml")
    if name == "solution":
        drawn = results[name].plot(["force.crank.x", "force.rocker.x"], path=tmp_path / "a.svg")
        assert [ax.get_ylabel() for ax in drawn.axes] == ["forces\n(N)"]
        assert (tmp_path / "a.svg").exists()


def test_a_package_that_is_missing_is_named(results, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match="needs the package 'pandas'"):
        results["drift"].to_pandas()


def test_what_has_no_columns_says_so(results, tmp_path):
    with pytest.raises(InputError, match="Card has no columns"):
        results["card"].save(tmp_path / "a.csv")
    with pytest.raises(InputError, match="Solution has no table"):
        results["solution"].to_latex()
    results["card"].save(tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text())["title"]


def test_columns_of_arrays_are_flat_in_files(tmp_path):
    write_csv({"a": [1, 2], "b": np.array([[1.0, 2.0], [3.0, 4.0]])}, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text() == "a,b[0],b[1]\n1,1.0,2.0\n2,3.0,4.0\n"
