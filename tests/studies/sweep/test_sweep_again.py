"""Sweeps resumed from a file, or not, and errors before any run."""

from contextlib import closing, contextmanager

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.cli.output import FAILED
from mbdae.errors import InputError
from mbdae.studies.sweep.results_file import SweepFile, write


class Failing:
    """A distribution of a user."""

    def rvs(self, random_state):
        return 1 / 0


def closing_over(g):
    def make(k):
        return mbdae.load("n_four_bar", N=g)

    return make


def test_a_table_has_what_was_computed_when_the_user_stopped(tmp_path, monkeypatch):
    """Ctrl-C comes after the second of six runs."""
    text = 'model = "pendulum"\nend = 0.05\noutputs = ["max energy"]\n[grid]\nsolve.rtol = '
    (tmp_path / "few.toml").write_text(text + "[1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8]")
    seen = []

    @contextmanager
    def bar(*_):
        def reported(done, text):
            seen.append(done)
            if len(seen) == 2:
                raise KeyboardInterrupt

        yield reported

    monkeypatch.setattr("mbdae.studies.sweep.command.bar", bar)
    table = tmp_path / "few.csv"
    out = CliRunner().invoke(cli, ["sweep", str(tmp_path / "few.toml"), "-o", str(table), "--workers", "1"])
    assert out.exit_code == FAILED
    assert f"wrote {table}" in out.output
    rows = table.read_text().splitlines()
    assert 2 <= len(rows) < 7
    assert f"stopped by the user after {len(rows) - 1} of 6 runs" in out.output


def test_functions_are_distinguished_by_their_captured_values(tmp_path):
    """Not by their names or their text: resuming would return the results of another sweep."""
    options = {"path": tmp_path / "runs.parquet", "executor": "threads"}
    count = [lambda s: {"n": s.q.shape[1]}]
    first = mbdae.sweep(closing_over(1), {"k": [1]}, 0.05, outputs=count, **options)
    again = mbdae.sweep(closing_over(1), {"k": [1]}, 0.05, outputs=[lambda s: {"n": s.q.shape[1]}], **options)
    assert first["n"].tolist() == again["n"].tolist() == [3.0]
    assert not again.seconds
    with pytest.raises(InputError, match="other mechanism"):
        mbdae.sweep(closing_over(2), {"k": [1]}, 0.05, outputs=count, **options)
    with pytest.raises(InputError, match="other functions"):
        mbdae.sweep(closing_over(1), {"k": [1]}, 0.05, outputs=[lambda s: {"n": 2.0 * s.q.shape[1]}], **options)


def test_an_interrupted_fresh_sweep_resumes_from_its_file(tmp_path):
    path = tmp_path / "runs.parquet"
    mbdae.sweep("pendulum", {"solve.rtol": [1e-3]}, 0.05, path=path)

    pressed = []

    def stop(done, text):
        if not pressed:
            pressed.append(done)
            raise KeyboardInterrupt

    grid = {"solve.rtol": [1e-3, 1e-4, 1e-5, 1e-6]}
    stopped = mbdae.sweep("pendulum", grid, 0.05, path=path, fresh=True, progress=stop, executor="threads", workers=1)
    assert not stopped.complete
    rest = mbdae.sweep("pendulum", grid, 0.05, path=path)
    assert rest.complete
    assert len(rest.seconds) == 4 - len(stopped)


def test_runs_that_finish_together_are_stored_one_by_one(tmp_path):
    """A write that ends within the last run loses that run alone."""
    written = mbdae.sweep("pendulum", {"solve.rtol": [1e-3, 1e-4, 1e-5]}, 0.05, outputs=["final energy"])
    path = tmp_path / "runs.parquet"
    with closing(SweepFile(path, written.kinds, written.meta, fresh=False)) as file:
        file.append(written.results)
    assert mbdae.Sweep.load(path).rows == written.rows
    part = tmp_path / "runs.parquet.part"
    part.write_bytes(part.read_bytes()[:-10])
    assert mbdae.Sweep.load(path).rows == written.rows[:-1]


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        ([lambda s: {"status": 3.0}], "'status', which is a column"),
        ([lambda s: {"a": 1.0}, lambda s: {"a": 2.0}], "two output functions return 'a'"),
    ],
)
def test_outputs_do_not_overwrite_columns(outputs, words):
    row = mbdae.sweep("pendulum", {"solve.rtol": [1e-3]}, 0.05, outputs=outputs, executor="threads").rows[0]
    assert (row["run"], row["status"]) == (0, "output")
    assert words in row["message"]


@pytest.mark.parametrize(
    ("parameters", "more", "words"),
    [
        (mbdae.Random(3, ["x"]), {}, "named by texts"),
        ([{3: 0.35}], {}, "named by texts"),
        ({"solve.rtol": [1e-3]}, {"path": 3}, "path is the name of a file"),
        ({"solve.rtol": [1e-3]}, {"backend": "nativ"}, "'nativ'"),
        ({"solve.rtol": [1e-3]}, {"times": [0.1, 0.05, 0.07]}, "in the span's order"),
        ({"solve.rtol": [1, 2**70]}, {}, "64 bits"),
        ({"gravity.2": {"from": 0.0, "to": 1.0, "n": 0}}, {}, "at least one run"),
        ({"gravity.2": np.array(3.0)}, {}, "a grid takes a list of values"),
        ({"gravity": [[0, 0, 10**400]]}, {}, "lists of numbers"),
        ({"solve.method": [[1.0]]}, {}, "unknown method"),
        (mbdae.Random(3, {"gravity.2": Failing()}), {}, "distribution of gravity.2 failed: ZeroDivisionError"),
        ([{"gravity.2": -1.0, "gravity": [0, 0, -9.81]}], {}, "'gravity' would replace 'gravity.2': give it first"),
    ],
)
def test_what_all_runs_share_is_rejected_at_once(parameters, more, words):
    with pytest.raises(mbdae.MbdaeError, match=words):
        mbdae.sweep("pendulum", parameters, 0.1, **more)


def test_numbers_of_stops_are_swept():
    # a point on a rod of 1 m falls from 1.2 rad to the stop at 0.3 rad: m l v = sqrt(2 g (cos 0.3 - cos 1.2))
    e = np.array([0.2, 0.5, 1.0])
    outputs = ["max impulse.rod stop", "min gap.rod stop", "q.rod", "mode.rod stop"]
    grid = {"stop.rod stop.restitution": e.tolist()}
    runs = mbdae.sweep("pendulum_on_stop", grid, 0.8, outputs=outputs, times=5, executor="threads")
    assert not runs.failed
    impulse = (1 + e) * np.sqrt(2 * 9.81 * (np.cos(0.3) - np.cos(1.2)))
    np.testing.assert_allclose(runs["max impulse.rod stop"], impulse, rtol=1e-6)
    assert np.min(runs["min gap.rod stop"]) > -1e-9
    assert np.ptp(np.stack(runs["q.rod"])[:, -1]) > 0.1
    with pytest.raises(InputError, match="rod stop"):
        mbdae.sweep("pendulum_on_stop", {"stop.rod.lower": [0.1]}, 0.8)


def test_outputs_have_the_units_of_their_signals(tmp_path):
    """A reduction has that of its signal, a parameter that of its key, in the table and after reading it."""
    pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    outputs = ["max v.joint1", "peak force.joint1", "q.joint2", "final energy"]
    path = tmp_path / "runs.parquet"
    table = mbdae.sweep("double_pendulum", {"gravity.2": [-9.81]}, (0, 0.1), outputs=outputs, times=3, path=path)
    wanted = {"t": "s", "gravity.2": "m/s^2", "max v.joint1": "rad/s", "peak force.joint1": "N", "q.joint2": "rad",
              "final energy": "J"}  # fmt: skip
    assert table.to_pandas().attrs["units"] == wanted
    assert mbdae.Sweep.load(path).to_pandas().attrs["units"] == wanted
    older = {key: x for key, x in table.meta.items() if key != "units"}
    write(path, table.results, table.kinds, older)
    again = mbdae.Sweep.load(path)
    assert again.to_pandas().attrs["units"] == {"t": "s"}
    np.testing.assert_array_equal(again["max v.joint1"], table["max v.joint1"])


def test_summaries_and_integrals_have_the_units_of_the_table(tmp_path):
    """A shaft turns steadily at 2 and 4 rad/s for 0.1 s: the integral of its speed is its angle, here in degrees."""
    path, way = tmp_path / "shaft.toml", 0.1 * 180 / np.pi
    body = '[[body]]\nname = "a"\nparent = "world"\njoint = "continuous"\ninertia = [1, 1, 1, 0, 0, 0]\n'
    path.write_text(f"{body}[start]\nq = {{ a = 0.0 }}\nv = {{ a = 1.0 }}\n")
    runs = mbdae.sweep(path, {"start.v.a": [2.0, 4.0]}, 0.1, outputs=["final q.a", "integral v.a", "integral q.a"])
    assert runs.to_columns().units["integral q.a"] == "rad s"
    with mbdae.display_units("deg", "ms"):
        lines = [line.split("  ") for line in str(runs).splitlines()]
    rows = {line[0]: [float(x) for x in line[1:] if x] for line in lines if line[0].endswith(")")}
    assert rows["final q.a (deg)"][::2] == pytest.approx([3 * way, 2 * way], rel=1e-5)  # mean and minimum
    assert rows["integral v.a (deg)"] == rows["final q.a (deg)"]
    assert rows["integral q.a (deg ms)"][2] == pytest.approx(2 * way * 100 / 2, rel=1e-5)
