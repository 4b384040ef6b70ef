"""Results in units of the trade: text, tables, columns and axes have converted numbers and the names of their units."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.studies.kinematics.figure import curves
from mbdae.studies.replay.plot_panels import panes
from mbdae.studies.solve.figure import motion
from mbdae.studies.tolerance.figure import bands
from mbdae.tabular import read_csv
from mbdae.units import DIMENSIONS, Units, displayed, elapsed

CONVERTED = [  # unit in SI, value, chosen units, value and unit as they are shown, from tables of units
    ("m", 0.0254, "in", 1.0, "in"),
    ("rad", np.pi, "deg", 180.0, "deg"),
    ("rad/s", 100 * np.pi, "rpm", 3000.0, "rpm"),
    ("rad/s", 100 * np.pi, "deg", 18000.0, "deg/s"),
    ("N m/rad/s", 2.0, "rpm,deg", 2.0 * np.pi / 180, "N m/deg/s"),  # of an integral gain: not per rad/s
    ("N m", 1.3558179483314004, "lbf ft", 1.0, "lbf ft"),
    ("N m", 2.0, "mm", 2000.0, "N mm"),
    ("N m/rad", np.pi / 180, "N m,deg", (np.pi / 180) ** 2, "N m/deg"),
    ("kg m^2", 2.0, "mm,g", 2e9, "g mm^2"),
    ("N/m^2", 6894.757293168362, "lbf,in", 1.0, "lbf/in^2"),
    ("m/s^2", 9.80665, "ft", 32.17404855643044, "ft/s^2"),
    ("m, rad", 1.0, "mm,deg", 1.0, "m, rad"),
    ("1", 1.0, "mm", 1.0, "1"),
]


def rows_of(path):
    return list(csv.reader(path.read_text().splitlines()))


@pytest.fixture(scope="module")
def sol():
    return mbdae.solve("slider_crank", (0, 0.3), rtol=1e-7)


@pytest.mark.parametrize(("unit", "x", "chosen", "value", "name"), CONVERTED)
def test_values_and_names_are_those_of_tables(unit, x, chosen, value, name):
    with mbdae.display_units(chosen):
        shown = displayed(x, unit)
    assert shown[0] == pytest.approx(value, rel=1e-14)
    assert shown[1] == name
    assert displayed(x, unit) == (x, unit)


@pytest.mark.parametrize(
    ("seconds", "chosen", "text"),
    [(7.216e-5, "s", "7.22e-05"), (0.0123456, "s", "0.0123"), (999.4, "s", "999"), (999.6, "s", "1000"),
     (12345.6, "s", "12346"), (7.216e-5, "ms", "0.0722"), (90.0, "min", "1.5")],
)  # fmt: skip
def test_measured_times_have_three_digits(seconds, chosen, text):
    with mbdae.display_units(chosen):
        assert elapsed(seconds) == text


def test_times_of_short_runs_are_shown(sol):
    """A run of less than half a millisecond is not one of 0.000 s."""
    study = mbdae.compare("pendulum", (0, 0.01), methods=["pherk5"], rtol=[1e-4], repeats=1)
    study = replace(study, points=[replace(study.points[0], times=(7.216e-5,))])
    assert str(study).splitlines()[6].endswith("  7.22e-05")
    run = replace(sol, stats={**sol.stats, "seconds": 7.216e-5})
    assert ", 7.22e-05 s, " in str(run)
    with mbdae.display_units("ms"):
        assert study.cells()[1][-1] == "0.0722"
        assert ", 0.0722 ms, " in str(run)


def test_units_of_one_name_have_one_dimension():
    names = [name for units in DIMENSIONS.values() for name in units]
    assert len(set(names)) == len(names)


def test_wrong_units_are_one_line(tmp_path):
    with pytest.raises(UnknownNameError, match="valid: m, mm, cm"):
        Units.parse(["inch"])
    with pytest.raises(InputError, match="mm and cm are both units of length"):
        Units.parse(["mm", "cm"])
    code, out, err = call("solve", "pendulum", "--units", "inch", cwd=tmp_path)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "unknown unit 'inch'" in err


def test_columns_of_files_are_labelled(sol, tmp_path):
    sol.save(tmp_path / "si.csv")
    with mbdae.display_units("mm", "deg"):
        sol.save(tmp_path / "mm.csv")
        sol.save(tmp_path / "run.npz")
        frame = pytest.importorskip("pandas") and sol.to_pandas()
    (headers, *rows), (_, *si) = (rows_of(tmp_path / f"{x}.csv") for x in ("mm", "si"))
    i, j = headers.index("q.slider [mm]"), headers.index("v.crank [deg/s]")
    for row, old in zip(rows, si, strict=True):
        assert float(row[i]) == pytest.approx(1e3 * float(old[i]), rel=1e-15)
        assert float(row[j]) == pytest.approx(180 / np.pi * float(old[j]), rel=1e-15)
    assert frame.attrs["units"]["position.rod_tip.x"] == "mm"
    np.testing.assert_allclose(frame["q.slider"], 1e3 * sol.q[:, -1], rtol=1e-15)
    np.testing.assert_array_equal(mbdae.Solution.load(tmp_path / "run.npz").q, sol.q)


def test_headings_with_units_are_read_back(sol, tmp_path):
    """A table in mm, deg and ms is the motion of one in SI: by reading it, and by the torque that it requires."""
    sol.save(tmp_path / "si.csv")
    with mbdae.display_units("mm", "deg", "ms", "mJ"):
        sol.save(tmp_path / "mm.csv")
    si, mm = (read_csv(tmp_path / f"{name}.csv").values for name in ("si", "mm"))
    for name, x in si.items():
        if name not in ("g", "Gv"):  # of several units
            np.testing.assert_allclose(mm[name], x, rtol=1e-14, atol=1e-300)
    torques = [mbdae.inverse_dynamics("slider_crank", tmp_path / f"{x}.csv", "crank").efforts for x in ("si", "mm")]
    np.testing.assert_allclose(*torques, rtol=1e-9, atol=1e-9)
    (tmp_path / "other.csv").write_text("t [min],q.a [rpm/s],note [turns],b [%],c [0]\n1,30,5,6,7\n")
    assert read_csv(tmp_path / "other.csv").values == {
        "t": 60, "q.a": pytest.approx(np.pi), "note [turns]": 5, "b [%]": 6, "c [0]": 7
    }  # fmt: skip


@pytest.mark.parametrize(
    ("words", "headers"),
    [
        ("equilibrium pendulum", "q.ball.z [mm]"),
        ("kinematics slider_crank --drive crank --points 9", "q.slider [mm]"),
        ("inverse-dynamics slider_crank --drive crank --speed 6 --points 9", "effort.crank [N mm]"),
        (
            "tolerance slider_crank --drive crank -s q.slider -p frame.rod_tip.xyz.0=5e-5 --points 9",
            "worst.q.slider [mm]",
        ),
    ],
)
def test_tables_of_studies_are_labelled(words, headers, tmp_path):
    for name, units in (("si", ()), ("mm", ("--units", "mm,deg"))):
        code, _, err = call(*words.split(), *units, "-o", f"{name}.csv", cwd=tmp_path)
        assert code == 0, err
    (names, *rows), (plain, *si) = (rows_of(tmp_path / f"{x}.csv") for x in ("mm", "si"))
    i, factor = names.index(headers), 1e3 if "mm" in headers else 180 / np.pi
    assert headers.startswith(plain[i])
    found, expected = (np.array([float(row[i]) for row in table]) for table in (rows, si))
    np.testing.assert_allclose(found, factor * expected, rtol=1e-9, atol=1e-9 * np.abs(factor * expected).max())


def labels(figure):
    return " ".join(" ".join((ax.get_xlabel(), ax.get_ylabel())) for ax in figure.axes)


@pytest.mark.slow
def test_axes_have_the_units_of_their_curves(sol):
    curve = mbdae.kinematics("slider_crank", "crank", points=9)
    study = mbdae.tolerance("slider_crank", "crank", ["position.slider_pin.x"], {"frame.rod_tip.xyz.0": 5e-5}, points=9)
    with mbdae.display_units("mm", "deg", "ms"):
        figures = motion(sol, ["q.slider", "q.crank"]), curves(curve), bands(study)
        dimensionless = [mbdae.inverse_dynamics("slider_crank", curve, speed=6.0).plot()]
    slider = figures[0].axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(slider, 1e3 * sol.q[:, -1], rtol=1e-15)
    np.testing.assert_allclose(figures[0].axes[0].lines[0].get_xdata(), 1e3 * sol.t, rtol=1e-15)
    for figure, words in zip(figures, (("(mm)", "(deg)", "(ms)"), ("(mm)", "mm/deg", "crank (deg)"), ("(mm)", "(deg)")),
                             strict=True):  # fmt: skip
        assert all(word in labels(figure) for word in words), labels(figure)
    assert "torque (N mm)" in labels(dimensionless[0])
    for figure in (*figures, *dimensionless):
        assert not any(word in labels(figure) for word in ("(m)", "(rad)", "(s)", "(N m)", "/rad"))


@pytest.mark.parametrize("plots", [None, ["q"]])
def test_plots_of_replays_have_the_units(sol, plots):
    with mbdae.display_units("mm", "deg"):
        found = panes(sol, plots, {"lead in m": lambda t, q, v: q[-1]})
    angles, positions = found[0], found[1]
    assert "(deg)" in angles.title
    crank = next(c for c in angles.curves if c.name == "crank")
    np.testing.assert_allclose(crank.y[[0, -1]], np.degrees(sol.signals("q.crank")["q.crank"][[0, -1]]), rtol=1e-12)
    assert "(mm)" in positions.title
    assert positions.curves[0].y[-1] == pytest.approx(1e3 * sol.q[-1, -1], rel=1e-12)
    assert found[-1].curves[0].y[-1] == sol.q[-1, -1]  # the user's signal as it is


@pytest.mark.slow
def test_commands_label_every_number(tmp_path):
    def text(*words):
        code, out, err = call(*words, "--units", "mm,deg", cwd=tmp_path)
        assert code == 0, err
        return out

    card = text("info", "slider_crank")
    assert "slider = " in card
    assert " mm, " in card or " mm\n" in card
    table = text("solve", "slider_crank", "-t", "0.1", "--signal", "q.slider,v.crank")
    assert "q.slider  mm " in table
    assert "v.crank   deg/s " in table
    assert "crank (deg)" in text("kinematics", "slider_crank", "--drive", "crank", "--points", "9", "--toggles")
    found = text("tolerance", "slider_crank", "--drive", "crank", "-s", "position.slider_pin.x",
                 "-p", "frame.rod_tip.xyz.0=5e-5", "--points", "9")  # fmt: skip
    assert "0.05 mm" in found
    assert "N mm at crank = " in text("inverse-dynamics", "slider_crank", "--drive", "crank", "--speed", "6")
