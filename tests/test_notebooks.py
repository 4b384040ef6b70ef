"""The notebooks run from top to bottom, their results are displayed, and none is stored with outputs."""

import re
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

NOTEBOOKS = Path(__file__).parent.parent / "examples" / "notebooks"
SECONDS = 300  # on a busy machine; alone each takes less than 20


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Run a notebook once in a separate folder; return the outputs of each code cell, by type."""
    done = {}

    def run(name):
        if name not in done:
            book = nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4)
            folder = tmp_path_factory.mktemp(name)
            client = nbclient.NotebookClient(book, timeout=SECONDS, resources={"metadata": {"path": str(folder)}})
            client.execute()
            assert not list(folder.iterdir())
            done[name] = [cell for cell in book.cells if cell.cell_type == "code"]
        return done[name]

    return run


def shown(cells, ending):
    """The output of the cell with this ending: its data by type."""
    (cell,) = [cell for cell in cells if cell.source.endswith(ending)]
    (data,) = [output.data for output in cell.outputs if output.output_type == "execute_result"]
    return data


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs_and_says_nothing_on_the_side(path, ran):
    assert not [cell for cell in nbformat.read(path, 4).cells if cell.get("outputs") or cell.get("execution_count")]
    for cell in ran(path.stem):
        streams = [output.text for output in cell.outputs if output.output_type == "stream" and output.name == "stderr"]
        assert not streams, streams
        bars = [output.data for output in cell.outputs if output.output_type == "display_data"]
        assert all(data["text/html"] == "" for data in bars), "a bar of progress is gone"


def test_a_bar_of_progress_shows_how_far_it_is_and_goes(tmp_path):
    code = """
import time, mbdae
with mbdae.progress_bar("<begin>") as progress:
    for step in ((0.25, "a step"), (0.5,), ("the end",)):
        time.sleep(0.11)
        progress(*step)
"""
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    said = []
    client = nbclient.NotebookClient(book, timeout=SECONDS, resources={"metadata": {"path": str(tmp_path)}})
    with pytest.MonkeyPatch.context() as patch:
        keep = client.process_message
        patch.setattr(client, "process_message", lambda msg, *rest: (said.append(msg), keep(msg, *rest))[1])
        client.execute()
    bars = [m["content"]["data"]["text/html"] for m in said if m["msg_type"] in ("display_data", "update_display_data")]
    assert bars == [
        "<progress></progress> &lt;begin&gt;",
        '<progress value="0.2500"></progress> a step',
        '<progress value="0.5000"></progress> a step',
        "<progress></progress> the end",
        "",
    ]
    assert [output.data["text/html"] for output in book.cells[0].outputs] == [""]


def test_simulate(ran):
    cells = ran("simulate")
    assert "wrist pin" in shown(cells, "\nmech")["text/html"]
    for ending in ("mbdae.view(mech)", "\nsol"):
        assert shown(cells, ending)["text/html"].startswith("<iframe srcdoc=")
    assert "force" in shown(cells, '"force.wrist pin"])')["image/svg+xml"]
    assert "|G v|" in shown(cells, "\ndrift")["text/html"]
    assert "<svg" in shown(cells, "drift.plot()")["image/svg+xml"]
    assert shown(cells, '["force.crank"]')["text/plain"] == "'N'"


def test_compare(ran):
    cells = ran("compare")
    table = shown(cells, "\nstudy")["text/html"]
    assert all(name in table for name in ("herk5", "pherk6", "radau5", "index1:dop853"))
    orders = shown(cells, "\norders")["text/html"]
    assert "herk3" in orders
    assert "misses" not in orders
    for ending in ("study.plot()", "orders.plot()"):
        assert "<svg" in shown(cells, ending)["image/svg+xml"]


def test_design(ran):
    cells = ran("design")
    assert "peak force.wrist pin" in shown(cells, "\nruns")["text/html"]
    found = shown(cells, "\nfound")
    (gravity,) = re.findall(r"gravity\.2\D*?(-\d+\.\d+)", found["text/plain"] + found["text/html"])[:1]
    assert abs(float(gravity) + 9.81) < 0.1, "a few standard deviations of the fit"
    for ending in ("runs.plot()", "found.plot()"):
        assert "<svg" in shown(cells, ending)["image/svg+xml"]
    assert "force.diagonal.stiffness" in shown(cells, "\nbest")["text/html"]
