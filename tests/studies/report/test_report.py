"""The report: one page that works offline, with every section, every figure, the replay, and how to reproduce it."""

import base64
import html
import json
import os
import re
import shlex
import signal
from pathlib import Path

import numpy as np
import pytest
from browser import Chromium
from commands import call, without_pictures

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.formats.model_library import model_names
from mbdae.studies.method_variant import default_variant, default_variants, variant_from_settings

OPTIONS = {"methods": ("pherk5", "ggl:herk3"), "tolerances": (1e-3, 1e-5), "rtol": 1e-6, "repeats": 1}
LIBRARY = Path(__file__).parents[3] / "models"
BLUE, RED = np.array([33, 97, 171]), np.array([200, 50, 45])


@pytest.fixture(scope="module")
def reported():
    return []


@pytest.fixture(scope="module")
def result(reported):
    tell = lambda done, name: reported.append(done)  # noqa: E731
    return mbdae.report(mbdae.load("slider_crank"), 1.0, **OPTIONS, progress=tell)


@pytest.fixture(scope="module")
def page(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    result.save(path)
    return path


def outside(text):
    """The page without the replay's frame and without data."""
    text = re.sub(r'srcdoc="[^"]*"', "", text)
    return re.sub(r"data:[\w/+]+;base64,[^\"]*", "data:", text)


def test_every_part_is_there(result, page):
    text = outside(page.read_text("utf-8"))
    assert re.findall(r'<h2 id="(\w+)">', text) == [
        "Model", "Parts", "Run", "Drift", "Orders", "Ranking", "Comparison", "Repeat", "Data"
    ]  # fmt: skip
    for words in (
        "Planar slider-crank", "wrist pin: revolute", "3 depend on others", "joint limits", "linear solves",
        "ggl:herk3, rtol 1e-06", "Observed (claimed) orders", "radau9, rtol 1e-12 differs",
        "linear solves for an error in q",
        f"mbdae {result.meta['versions']['mbdae']}", '"tolerances": [0.001, 1e-05]',
    ):  # fmt: skip
        assert words in html.unescape(text), words
    assert "{{" not in text


def test_the_page_needs_nothing_from_outside(page):
    text = page.read_text("utf-8")
    assert not re.search(r"https?:|wss?:|\shref=\"(?!#|data:)|@import", outside(text))
    frame = html.unescape(re.search(r'<iframe srcdoc="([^"]*)"', text)[1])
    assert not re.search(r"https?:|wss?:|\ssrc=|\shref=|@import", frame)
    assert [p.name for p in page.parent.iterdir()] == ["report.html"]
    assert page.stat().st_size < 4e6


def test_figures_are_whole_pictures(page):
    pictures = re.findall(r'<img[^>]* alt="([^"]+)" src="data:image/svg\+xml;base64,([^"]+)"', page.read_text("utf-8"))
    assert [alt for alt, _ in pictures] == [
        "the mechanism at the start of the run",
        "motion over time",
        "drift of the closures and of the energy over time",
        "convergence",
        "work-precision diagram",
    ]
    for _, data in pictures:
        svg = base64.b64decode(data).decode()
        assert svg.rstrip().endswith("</svg>")
        assert svg.count("<path") > 20


def test_every_figure_and_every_table_of_numbers_has_a_caption(page):
    text = outside(page.read_text("utf-8"))
    tables = len(re.findall("<table>", text))
    assert tables >= 7
    assert len(re.findall(r'<p class="caption">[^<]+</p><div class="wide"><table>', text)) == tables
    assert text.count("<figcaption>") == text.count("<img ") == 5


def test_what_repeats_it_is_in_it(result, page):
    text = page.read_text("utf-8")
    described = json.loads(html.unescape(re.search(r"<pre>(.*?)</pre>", text, re.S)[1]))
    again = mbdae.mechanism.restore(described, [])
    np.testing.assert_array_equal(np.concatenate(again.start), np.concatenate(result.sol.mechanism.start))
    assert result.meta["parameters"]["methods"] == list(OPTIONS["methods"])
    assert {"mbdae", "pin", "numpy", "scipy", "python"} == set(result.meta["versions"])


NUMBERS = re.compile(r"t = (\S+) s\n  (\d+ steps, \S+ rejected, \d+ solves)")


@pytest.mark.parametrize("name", model_names())
def test_the_run_of_a_report_is_that_of_the_command_line_and_of_solve(name, monkeypatch):
    """The same steps, drift and energy balance, with default settings; and the comparison begins with that method."""
    compared = []
    monkeypatch.setattr("mbdae.studies.report.report.METHODS", ("pherk6",))
    monkeypatch.setattr("mbdae.studies.report.report.order", lambda *_, **__: None)
    monkeypatch.setattr("mbdae.studies.report.report.compare", lambda *_, **o: compared.extend(o["methods"]))
    mech = mbdae.load(name)
    T = min(mech.duration, 0.05)
    sol = mbdae.solve(mech, (0, T))
    assert sol.settings["rtol"] == 1e-8
    found = mbdae.report(mech, T)
    printed = call("solve", name, "-t", T)[1]
    assert NUMBERS.search(printed)[0] == NUMBERS.search(str(found))[0] == NUMBERS.search(str(sol))[0]
    np.testing.assert_array_equal(found.sol.y, sol.y)
    assert all(str(mbdae.drift(sol)) in text for text in (printed, str(found)))
    assert compared[0] == variant_from_settings(sol.settings) == default_variant(mech)
    closed = mech.ng > 0
    assert [str(v) for v in compared] == (["project:pherk6", "pherk6"] if closed else ["pherk6"])
    assert f"{compared[0]}, rtol 1e-08" in str(found)


def test_the_page_shows_the_numbers_of_the_run(result, page):
    numbers = NUMBERS.search(str(result.sol))
    assert f"t = {numbers[1]} s. {numbers[2]}, " in outside(page.read_text("utf-8"))
    assert "project:pherk5, rtol 1e-06: finished" in outside(page.read_text("utf-8"))


def test_what_a_file_says_of_runs_is_what_report_and_comparison_begin_with(tmp_path):
    """A mechanism with its method in the file, and one with fixed steps: without projection, as its run."""
    text = (LIBRARY / "slider_crank" / "mechanism.toml").read_text("utf-8")
    text = text.replace('"slider_crank.urdf"', f'"{LIBRARY}/slider_crank/slider_crank.urdf"')
    for said, words in (('method = "herk5"\nrtol = 1e-5', "project:herk5"), ("step = 1e-2", "pherk6")):
        path = tmp_path / "own.toml"
        path.write_text(f"{text}\n[solve]\n{said}\n", "utf-8")
        mech = mbdae.load(path)
        assert str(default_variants(mech, ["herk5"])[0]) == words
        assert str(variant_from_settings(mbdae.solve(mech, (0, 0.05)).settings)) == words
    assert str(default_variant(mech, rtol=1e-6)) == "project:pherk6", "a tolerance takes the place of the step"


def test_results_are_data_and_text(result, reported):
    data = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert set(data) == {"card", "run", "drift", "orders", "comparison", "meta", "missing"}
    assert [d["method"] for d in data["drift"]] == ["project:pherk5", *OPTIONS["methods"]], "the run is first"
    assert data["run"]["settings"]["project"] is True
    assert list(data["orders"]["methods"]) == ["pherk5"]
    assert len(data["comparison"]["points"]) == 4
    assert str(result.orders) in str(result)
    assert reported == sorted(reported)
    assert reported[-1] <= 1


def test_an_order_that_is_missed_is_said_in_words(result):
    from dataclasses import replace

    from mbdae.studies.report import page

    slopes = result.orders.orders["pherk5"]
    missed = replace(result.orders, orders={"pherk5": (replace(slopes[0], verdict="misses"), *slopes[1:])})
    assert "pherk5, q: misses" in page._orders(replace(result, orders=missed))


def test_names_are_escaped(result, tmp_path, monkeypatch):
    from dataclasses import replace

    without_pictures(monkeypatch)
    title = "<b>a & b</b>"
    replace(result, card=replace(result.card, title=title)).save(tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text("utf-8")
    assert f"<title>{html.escape(title)}</title>" in text
    assert title not in outside(text)


def test_wrong_input_is_rejected(result, tmp_path):
    with pytest.raises(InputError, match=r"\.html, got"):
        result.save(tmp_path / "report.pdf")
    with pytest.raises(InputError, match="unknown method"):
        mbdae.report(mbdae.load("slider_crank"), 1.0, methods=["herk9"])
    assert not list(tmp_path.iterdir())


def test_the_command_writes_it(tmp_path, monkeypatch):
    without_pictures(monkeypatch)
    arguments = shlex.split("report pendulum -t 0.5 -m herk3 --rtol 1e-5 --repeats 1 -o r.html --json")
    code, out, err = call(*arguments, cwd=tmp_path)
    assert (code, err) == (0, "")
    data = json.loads(out, parse_constant=pytest.fail)
    assert data["written"] == ["r.html"]
    assert data["meta"]["command"] == "mbdae " + " ".join(arguments)
    assert data["meta"]["command"] in (tmp_path / "r.html").read_text("utf-8")


def test_tables_are_numbers_of_the_mechanism_and_the_ranking_that_of_the_comparison(result):
    from mbdae.studies.report.report_tables import component_tables, ranking

    text = html.unescape(re.sub(r"<[^>]+>", "|", component_tables(result.sol.mechanism)))
    model = result.sol.mechanism.model
    for i in range(1, model.njoints):
        assert re.search(rf"\|{model.names[i]}\|+{model.inertias[i].mass:.5g}\|", text)
    assert "wrist pin||revolute|" in text
    assert re.search(r"\|crank\|+revolute\|", text)
    kinds = {"pendulum_on_stop": "rod stop||stop||rod||1", "ratchet": "driving pawl||clutch||wheel - rocker||1"}
    for name, row in kinds.items():
        assert row in re.sub(r"<[^>]+>", "|", component_tables(mbdae.load(name)))
    table = ranking(result.comparison)
    places = result.comparison.ranking(1e-4)
    best = min((p for p in places if p.work is not None), key=lambda p: p.work)
    assert f"{best.work:.0f}</b>" in table or f"{best.work:.3g}</b>" in table
    assert table.count("<tr>") == 2 * (1 + len(OPTIONS["methods"]))


def test_data_is_inside(result, page):
    text = page.read_text("utf-8")
    files = dict(re.findall(r'<a download="([\w.]+)" href="data:[\w/]+;base64,([^"]*)"', text))
    assert set(files) == {"comparison.csv", "report.json", "run.csv"}
    data = {name: base64.b64decode(content).decode() for name, content in files.items()}
    assert json.loads(data["report.json"])["card"]["title"] == result.card.title
    assert data["run.csv"].count("\n") > len(result.sol.t)
    assert data["comparison.csv"].count("pherk5") >= 2


def test_a_browser_shows_text_figures_and_replay(page):
    ready = "document.querySelector('iframe').contentWindow.mbdae"
    with Chromium().open(page.as_uri(), (1000, 900), ready) as tab:
        tab.evaluate("document.querySelector('iframe').scrollIntoView(); 0")
        scene = tab.picture()
        for colour in (BLUE, RED):  # rod and crank
            assert (np.abs(scene - colour).max(axis=2) < 45).mean() > 0.002
        tab.evaluate("document.querySelectorAll('figure')[2].scrollIntoView(); 0")
        orange = np.abs(tab.picture() - np.array([217, 72, 1])).max(axis=2) < 20  # pherk5 in the figures
        assert orange.sum() > 200
        tab.resize((390, 844))
        assert tab.evaluate("document.documentElement.scrollWidth") == 390, "fits a phone"


@pytest.mark.parametrize(
    ("at", "missing", "orders", "points"),
    [
        ("run, ggl:herk3", ("runs of ggl:herk3, herk2", "orders", "the comparison"), None, None),
        ("order, herk2", ("orders of herk2", "the comparison"), ["pherk6"], None),
        ("compare, reference", ("the comparison",), ["pherk6", "herk2"], None),
        ("compare, herk2, rtol 0.001", ("1 of 3 runs of the comparison",), ["pherk6", "herk2"], 2),
        ("compare, time 2", ("times of the comparison",), ["pherk6", "herk2"], 3),
    ],
)
def test_ctrl_c_keeps_what_is_finished(at, missing, orders, points):
    def stop(done, name):
        if name.startswith(at):
            raise KeyboardInterrupt

    options = OPTIONS | {"methods": ("pherk6", "ggl:herk3", "herk2")} | {"tolerances": (1e-3,), "workers": 1}
    options |= {"repeats": 2} if "time" in at else {}
    found = mbdae.report(mbdae.load("pendulum"), 0.3, **options, progress=stop)
    assert found.missing == missing
    assert (found.orders and [*found.orders.orders]) == orders
    assert (found.comparison and len(found.comparison.points)) == points
    assert str(found).endswith(f"stopped by the user without {'; '.join(missing)}")


def test_ctrl_c_writes_what_is_finished(tmp_path, monkeypatch):
    without_pictures(monkeypatch)
    monkeypatch.setattr("mbdae.studies.report.report.METHODS", ("pherk6", "herk2"))
    press = lambda *_, **__: os.kill(os.getpid(), signal.SIGINT)  # noqa: E731
    monkeypatch.setattr("mbdae.studies.report.report.order", press)
    code, out, err = call("report", "pendulum", "-t", "0.3", "-o", "r.html", cwd=tmp_path)
    assert (code, err) == (1, "mbdae: stopped by the user without orders; the comparison\n")
    assert out.endswith("without orders; the comparison\n\nwrote r.html\n")
    text = outside((tmp_path / "r.html").read_text("utf-8"))
    assert "Stopped by the user without orders; the comparison." in text
    assert re.findall(r'<h2 id="(\w+)">', text) == ["Model", "Parts", "Run", "Drift", "Repeat", "Data"]


def test_ctrl_c_while_the_page_is_written_leaves_what_it_would_say(tmp_path, monkeypatch):
    monkeypatch.setattr("mbdae.studies.report.report.METHODS", ("ggl:herk2",))
    monkeypatch.setattr("mbdae.studies.report.report.compare", lambda *_, **__: None)
    monkeypatch.setattr("mbdae.studies.report.page.page", lambda report: os.kill(os.getpid(), signal.SIGINT))
    code, out, err = call("report", "pendulum", "-t", "0.1", "-o", "r.html", cwd=tmp_path)
    assert (code, err) == (1, "mbdae: stopped by the user before r.html was written\n")
    assert "drift of Cartesian pendulum" in out
    assert list(tmp_path.iterdir()) == []


def test_solvers_of_libraries_have_no_orders():
    """They take no fixed steps; everything else of the report is there."""
    pytest.importorskip("sksundae")
    result = mbdae.report("four_bar", 0.05, methods=("ida", "ggl:ida"), tolerances=(1e-3,), repeats=0)
    assert result.orders is None
    assert not result.missing
    assert [d.method for d in result.drifts] == ["ida", "ggl:ida"]
    assert {p.method for p in result.comparison.points if p.success} == {"ida", "ggl:ida"}
