"""The notebooks run from top to bottom, their results are displayed, and none is stored with outputs."""

import re
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
jupyter_client = pytest.importorskip("jupyter_client")

pytestmark = pytest.mark.slow
NOTEBOOKS = Path(__file__).parent.parent / "examples" / "notebooks"
SECONDS = 300  # on a busy machine; alone each takes less than 20


@pytest.fixture(scope="module")
def execute():
    """Run a notebook in a folder, in one kernel for all, which imports once; every notebook begins without names."""
    kernel = jupyter_client.KernelManager()

    def run(book, folder, **hooks):
        book.cells.insert(0, nbformat.v4.new_code_cell(f"%reset -f\n%cd -q {folder}"))
        where = {"metadata": {"path": str(folder)}}
        client = nbclient.NotebookClient(book, km=kernel, timeout=SECONDS, resources=where)
        for name, hook in hooks.items():
            setattr(client, name, hook(getattr(client, name)))
        client.execute()
        client.kc.stop_channels()
        del book.cells[0]
        return [cell for cell in book.cells if cell.cell_type == "code"]

    yield run
    kernel.shutdown_kernel(now=True)


@pytest.fixture(scope="module")
def ran(tmp_path_factory, execute):
    """Run a notebook once in a separate folder; return its code cells with their outputs."""
    done = {}

    def run(name):
        if name not in done:
            folder = tmp_path_factory.mktemp(name)
            done[name] = execute(nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4), folder)
            assert not list(folder.iterdir())
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


def test_a_bar_of_progress_shows_how_far_it_is_and_goes(execute, tmp_path):
    code = """
import time, mbdae
with mbdae.progress_bar("<begin>") as progress:
    for step in ((0.25, "a step"), (0.5,), ("the end",)):
        time.sleep(0.11)
        progress(*step)
"""
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    said = []

    def heard(keep):
        return lambda message, *rest: (said.append(message), keep(message, *rest))[1]

    (cell,) = execute(book, tmp_path, process_message=heard)
    bars = [m["content"]["data"]["text/html"] for m in said if m["msg_type"] in ("display_data", "update_display_data")]
    assert bars == [
        "<progress></progress> &lt;begin&gt;",
        '<progress value="0.2500"></progress> a step',
        '<progress value="0.5000"></progress> a step',
        "<progress></progress> the end",
        "",
    ]
    assert [output.data["text/html"] for output in cell.outputs] == [""]


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
