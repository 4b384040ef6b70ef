"""Figures: units on the axes, legends next to the data, one style per method, nothing drawn that is unknown."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from commands import without_layout

import mbdae
from mbdae.errors import InputError
from mbdae.file_io import PICTURE_SUFFIXES
from mbdae.integrate.steppers.ida import IDA
from mbdae.integrate.steppers.scipy_ivp import SCIPY
from mbdae.solution.signals import units
from mbdae.studies import figures
from mbdae.studies.comparison.comparison import Comparison
from mbdae.studies.comparison.figure import work_precision
from mbdae.studies.comparison.run_result import RunResult
from mbdae.studies.drift.figure import drifts
from mbdae.studies.order.figure import convergence
from mbdae.studies.order.result import ObservedOrder, OrderStudy
from mbdae.studies.solve.figure import motion
from mbdae.studies.sweep.figure import spread

NAMES = ("pherk5", "ggl:pherk5", "herk3", "index1:DOP853")
QVLAM = ("q", "v", "lam")


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load("four_bar")


def comparison(uncertainty=1e-11):
    """Errors of order 4 and 5 over work, the smallest of them below the accuracy of the reference."""
    points = []
    for i, name in enumerate(NAMES):
        for k in range(1, 6):
            error, work = 10.0 ** (-2 * k - 0.5 * i), int(200 * 10 ** (0.4 * k))
            points.append(
                RunResult(
                    name, 10.0**-k, None, "finished", dict.fromkeys(QVLAM, error), solves=work, times=(work * 1e-4,)
                )
            )
    points.append(RunResult("herk1", 1e-3, None, "max_steps"))
    return Comparison("Test", (0.0, 1.0), tuple(points), "a", "b", dict.fromkeys(QVLAM, uncertainty))


def orders():
    h = 1 / np.array([10, 20, 40, 80, 160, 320])
    slopes = {}
    for name, p in (("herk3", 3), ("pherk5", 5)):
        n = tuple(int(x) for x in 1 / h)
        seen = (n, tuple(h ** (p + 0.02)), (1e-12,) * 6, (1, 6))
        fits = [ObservedOrder(quantity, p, p + 0.02, "holds", *seen) for quantity in ("q", "v", "own lam")]
        slopes[name] = (*fits, ObservedOrder("lam", p, None, "cannot be judged: x", n, tuple(h**p), (1.0,) * 6))
    units = {"q": "rad", "v": "rad/s", "own lam": "N", "lam": "N"}
    return OrderStudy("Test", 1.0, slopes, units=units)


@pytest.fixture(scope="module")
def drawn(four_bar):
    sols = [mbdae.solve(four_bar, (0, 1), rtol=1e-6, method=m, project=False) for m in ("pherk5", "herk3")]
    return {
        "motion": motion(sols[0]),
        "drifts": drifts([mbdae.drift(sol).history for sol in sols]),
        "work_precision": work_precision(comparison()),
        "convergence": convergence(orders()),
    }


@pytest.fixture
def data_only(monkeypatch):
    """Leave out layouts, for tests of the data of figures."""
    without_layout(monkeypatch)


KINDS = ("motion", "drifts", "work_precision", "convergence")


@pytest.mark.parametrize("kind", KINDS)
def test_axes_have_labels_with_units(drawn, kind):
    shown = [ax for ax in drawn[kind].axes if ax.lines]
    assert shown
    assert all(ax.get_ylabel() for ax in shown if ax.get_subplotspec().is_first_col() or kind == "convergence")
    words = [label for ax in shown for label in (ax.get_xlabel(), ax.get_ylabel()) if label]
    plain = {"residuals", "linear solves", "$|E - E_0 - W|$ / scale"}  # units in the legend, or none
    assert all(("(" in w and w.endswith(")")) or w in plain for w in words), words


@pytest.mark.parametrize("kind", KINDS)
def test_legends_are_beside_the_data(drawn, kind):
    figure = drawn[kind]
    figure.draw_without_rendering()
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]
    assert legends
    whole = figure.bbox
    for legend in legends:
        box = legend.get_window_extent()
        assert not any(box.overlaps(ax.get_window_extent()) for ax in figure.axes)
        assert box.x0 >= whole.x0 - 1
        assert box.x1 <= whole.x1 + 1
        assert box.y0 >= whole.y0 - 1


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("suffix", [s for s in PICTURE_SUFFIXES if s != ".pgf"])
def test_every_format_is_written_and_the_same_twice(drawn, kind, suffix, tmp_path):
    start = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix]
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for path in paths:
        figures.save(drawn[kind], path)
    assert paths[0].read_bytes()[: len(start)] == start
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_other_formats_are_rejected(drawn, tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"\.png, \.svg, \.pdf, \.pgf, got"):
        figures.save(drawn["motion"], tmp_path / "a.jpg")
    without_layout(monkeypatch)
    with pytest.raises(InputError, match=r"\.png"):
        comparison().plot(tmp_path / "a.gif")
    with pytest.raises(InputError, match="cannot write"):
        orders().plot(tmp_path / "missing" / "a.png")
    assert not list(tmp_path.iterdir())


def test_every_method_has_a_distinct_style():
    names = [*mbdae.METHODS, IDA.name, *(f"index1:{name}" for name in SCIPY)]
    styles = {name: figures.line_style(name) for name in names}
    pairs = {(s["color"], s["marker"]) for s in styles.values()}
    assert len(pairs) == len(names)
    assert figures.DEFAULT_STYLE not in pairs, "a method of the list is drawn like an unknown one"
    lines = {str(figures.line_style(f)["linestyle"]) for f in ("herk5", "project:herk5", "ggl:herk5", "index1:RK45")}
    assert len(lines) == 4
    assert figures.line_style("ggl:herk5")["color"] == figures.line_style("herk5")["color"]
    assert figures.line_style("radau13")["marker"], "methods on demand are drawn too"


def test_the_default_methods_differ_in_grey():
    from mbdae.studies.comparison.selection import METHODS

    styles = [figures.line_style(name) for name in METHODS]
    assert len({(s["marker"], s["markerfacecolor"] == "white", str(s["linestyle"])) for s in styles}) == len(METHODS)


def test_a_method_has_the_same_style_in_all_figures(drawn):
    colours = []
    for kind in ("drifts", "work_precision", "convergence"):
        lines = [line for ax in drawn[kind].axes for line in ax.lines if str(line.get_label()).startswith("pherk5")]
        assert lines
        colours += [(line.get_color(), line.get_marker()) for line in lines]
    assert len(set(colours)) == 1


@pytest.mark.usefixtures("data_only")
def test_runs_of_one_method_and_of_several_mechanisms_are_distinguished(four_bar):
    pendulum = mbdae.load("pendulum")
    options = {"method": "pherk5", "project": False}
    runs = [mbdae.drift(mbdae.solve(four_bar, (0, 0.2), rtol=r, **options)).history for r in (1e-4, 2.5e-4)]
    figure = drifts(runs)
    lines = figure.axes[0].get_lines()
    assert [line.get_label() for line in lines] == ["pherk5, rtol 1e-04", "pherk5, rtol 2.5e-04"]
    assert lines[0].get_color() != lines[1].get_color()
    assert lines[0].get_linestyle() != lines[1].get_linestyle()
    figure = drifts([runs[0], mbdae.drift(mbdae.solve(pendulum, (0, 0.2), rtol=1e-4, **options)).history])
    assert figure.get_suptitle() == f"Drift of {four_bar.title}, {pendulum.title}"
    labels = [line.get_label() for line in figure.axes[0].get_lines()]
    assert labels == [f"{m.title}: pherk5, rtol 1e-04" for m in (four_bar, pendulum)]


@pytest.mark.usefixtures("data_only")
def test_unknown_errors_are_bounds_and_not_joined():
    result = comparison()
    ax = work_precision(result).axes[0]
    floor = result.floor()
    curves = {line.get_label(): line.get_ydata() for line in ax.lines if line.get_label() in NAMES}
    assert set(curves) == set(NAMES)
    assert all(min(y) >= floor for y in curves.values())
    assert [len(curves[name]) for name in NAMES] == [5, 4, 4, 4]
    bounds = [line for line in ax.lines if line.get_linestyle() == "None" and np.allclose(line.get_ydata(), floor)]
    assert bounds
    assert "below the accuracy of the reference" in [text.get_text() for text in ax.texts]
    known = work_precision(comparison(1e-15)).axes[0]
    assert not known.texts, "no band where everything is known"


@pytest.mark.usefixtures("data_only")
def test_times_that_were_not_taken_are_not_drawn():
    runs = [(r, dict.fromkeys(QVLAM, r)) for r in (1e-2, 1e-3)]
    points = tuple(RunResult("herk3", r, None, "finished", errors, solves=int(1 / r)) for r, errors in runs)
    result = Comparison("Test", (0.0, 1.0), points, "a", "b", dict.fromkeys(QVLAM, 1e-12))
    solves, seconds = work_precision(result).axes
    assert len(solves.lines[0].get_xdata()) == 2
    assert not seconds.lines


def test_slopes_are_those_of_the_study(drawn):
    ax = drawn["convergence"].axes[0]
    entries = [text.get_text() for text in ax.get_legend().get_texts()]
    assert entries == ["herk3 3.02 (3)", "pherk5 5.02 (5)"]
    last = [text.get_text() for text in drawn["convergence"].axes[3].get_legend().get_texts()]
    assert last == ["herk3 - (3)", "pherk5 - (5)"]
    fits = [line for line in ax.lines if line.get_linestyle() == "-" and len(line.get_xdata()) == 2]
    slopes = [np.diff(np.log(line.get_ydata()))[0] / np.diff(np.log(line.get_xdata()))[0] for line in fits]
    assert slopes == pytest.approx([3.02, 5.02])


@pytest.mark.slow
def test_the_user_s_settings_neither_matter_nor_change(four_bar, tmp_path):
    sol = mbdae.solve(four_bar, (0, 0.2))
    figures.save(motion(sol), tmp_path / "a.svg")
    with mpl.rc_context({"lines.linewidth": 9.0, "font.size": 30.0, "axes.facecolor": "red"}):
        figures.save(motion(sol), tmp_path / "b.svg")
        assert mpl.rcParams["lines.linewidth"] == 9.0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


@pytest.mark.usefixtures("data_only")
def test_panels_by_unit():
    mech = mbdae.load("slider_crank")
    unit = units(mech)
    assert (unit["q.crank"], unit["v.crank"], unit["q.slider"], unit["v.slider"]) == ("rad", "rad/s", "m", "m/s")
    figure = motion(mbdae.solve(mech, (0, 0.5)))
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels[:4] == ["angles\n(rad)", "positions\n(m)", "angular velocities\n(rad/s)", "speeds\n(m/s)"]


@pytest.mark.slow
@pytest.mark.usefixtures("data_only")
def test_dollars_in_names_are_dollars(tmp_path, four_bar):
    title = r"press $5_^ to \$ 7$ $\frac"
    mech = mbdae.Mechanism(four_bar.model, four_bar.closures, start=four_bar.start_values, title=title)
    sol = mbdae.solve(mech, (0, 0.1), rtol=1e-3)

    def last(sol):
        return {title: float(sol.q[-1, 0])}

    runs = [{"start.q.crank": x} for x in (1.1, 1.2)]
    grid = mbdae.sweep("four_bar", runs, 0.1, outputs=[last], executor="threads", rtol=1e-3)
    drawings = (
        motion(sol),
        drifts([mbdae.drift(sol).history] * 2),
        work_precision(replace(comparison(), title=title)),
        convergence(replace(orders(), title=title)),
        spread(grid, title),
    )
    for i, figure in enumerate(drawings):
        figures.save(figure, tmp_path / f"{i}.svg")
    for figure in drawings[:4]:
        assert title in figure._suptitle.get_text().replace(r"\$", "$")


@pytest.mark.parametrize("ratio", [1.05, 1.3, 2.0, 2.8, 3.5, 4.5, 1e3, 1e7, 1e12])
@pytest.mark.parametrize("low", [105.0, 95.0, 0.0021])
def test_labels_of_logarithmic_axes_do_not_overlap(low, ratio):
    @figures.fixed_layout
    def drawing():
        figure = figures.empty_figure(figures.WIDTH, 3.5)
        ax = figure.subplots(1, 2)[0]
        figures.logarithmic(ax.xaxis)
        ax.set_xlim(low, low * ratio)
        return figure

    figure = drawing()
    ax = figure.axes[0]
    figure.draw_without_rendering()
    labels = [text for minor in (False, True) for text in ax.get_xticklabels(minor=minor) if text.get_text()]
    boxes = [text.get_window_extent() for text in labels if low <= text.get_position()[0] <= low * ratio]
    assert len(boxes) >= 2
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
