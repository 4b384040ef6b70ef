"""Solutions in files: saved data are read back, and unreadable files give a one-line error."""

import csv
import json
import warnings
import zipfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from shared import shared_model

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.forces.joint_pid import JointPID
from mbdae.mechanism.model_settings import Start
from mbdae.solution import archive
from mbdae.solution.provenance import version_of, versions
from mbdae.textbook.problems import hessenberg_a

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="module")
def sol():
    return mbdae.solve(shared_model("four_bar"), (0, 2), rtol=1e-8)


@pytest.fixture(scope="module")
def spinner():
    """An unbounded revolute joint that turns more than half a turn in a step, a ball joint and a free body."""
    model = pin.Model()
    kinds = (pin.JointModelRUBZ(), pin.JointModelSpherical(), pin.JointModelFreeFlyer(), pin.JointModelPlanar())
    for name, kind in zip(("shaft", "ball", "body", "plate"), kinds, strict=True):
        joint = model.addJoint(0, kind, pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.1, 0.2, 0.3), pin.SE3.Identity())
    model.gravity.linear = np.zeros(3)
    start = Start(v={"shaft": 40.0, "ball": [0.1, 0.2, 0.3]})
    return mbdae.solve(mbdae.Mechanism(model, start=start), (0, 1), step=0.1)


def rewritten(path, target, **changes):
    """A copy of a solution file with replaced metadata entries."""
    with np.load(path) as file:
        data = {name: file[name] for name in file.files}
    data["meta"] = np.array(json.dumps({**json.loads(str(data["meta"])), **changes}))
    np.savez(target, **data)
    return target


def test_what_was_saved_is_read_again(sol, tmp_path):
    sol.save(tmp_path / "run.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = mbdae.Solution.load(tmp_path / "run.npz")
    for name in ("t", "q", "v", "lam", "lam_own", "work"):
        np.testing.assert_array_equal(getattr(again, name), getattr(sol, name))
    assert (again.status, again.stats, again.settings) == (sol.status, sol.stats, sol.settings)
    np.testing.assert_array_equal(again(1.234).q, sol(1.234).q)
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_events_are_read_again(tmp_path):
    texts = ["v.crank = 0", "lam.pin.1 > 1e9", lambda t, q, v: t - 0.5]
    sol = mbdae.solve(shared_model("four_bar"), (0, 4), events=texts, t_eval=[0.0, 1.0])
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    assert [len(t) for t, _ in sol.events][1:] == [0, 1]
    assert len(sol.events[0][0]) > 1
    for (t, y), (t1, y1) in zip(again.events, sol.events, strict=True):
        np.testing.assert_array_equal(t, t1)
        np.testing.assert_array_equal(y, y1)
        assert y.shape == (len(t), sol.y.shape[1])
    assert again.stats["events"] == sol.stats["events"]
    with np.load(tmp_path / "run.npz") as file:
        np.savez(tmp_path / "bad.npz", **{**dict(file), "event_2_y": np.zeros((1, 3))})
    with pytest.raises(InputError, match="shapes"):
        mbdae.Solution.load(tmp_path / "bad.npz")


def test_signals_are_named_columns(sol):
    signals = sol.signals()
    assert list(signals)[:7] == ["t", "q.crank", "q.coupler", "q.rocker", "v.crank", "v.coupler", "v.rocker"]
    assert [n for n in signals if n.startswith("lam.")] == ["lam.pin.1", "lam.pin.2", "lam.pin.3"]
    assert list(signals)[-6:] == ["kinetic", "potential", "energy", "work", "g", "Gv"]
    assert {column.shape for column in signals.values()} == {sol.t.shape}
    np.testing.assert_array_equal(signals["q.coupler"], sol.q[:, 1])
    np.testing.assert_array_equal(signals["lam.pin.3"], sol.lam[:, 2])
    drift = mbdae.drift(sol)
    assert signals["g"].max() == drift.g_max
    balance = signals["energy"] - signals["energy"][0] - signals["work"]
    assert np.abs(balance).max() == pytest.approx(drift.energy_error)


def test_angles_are_unwrapped_and_parts_have_names(spinner):
    signals = spinner.signals()
    np.testing.assert_allclose(signals["q.shaft"], 40 * spinner.t, atol=1e-9)
    assert {n for n in signals if n.startswith("q.ball")} == {f"q.ball.q{c}" for c in "xyzw"}
    assert "v.ball.wz" in signals
    assert {"q.body.x", "q.body.qw", "v.body.vx", "q.plate.cos", "v.plate.wz"} < set(signals)
    sparse = mbdae.solve(spinner.mechanism, (0, 1), step=0.1, t_eval=[0.0, 0.55, 1.0])
    np.testing.assert_allclose(sparse.signals("q.shaft")["q.shaft"], [0.0, 22.0, 40.0], atol=1e-6)
    back = mbdae.solve(spinner.mechanism, (1, 0), step=0.1, t_eval=[1.0, 0.25])
    np.testing.assert_allclose(back.signals("q.shaft")["q.shaft"], [0.0, -30.0], atol=1e-6)


def test_states_of_forces_are_kept(tmp_path):
    mech = mbdae.load("four_bar", forces=[JointPID(joint="crank", kp=5.0, ki=3.0, kd=1.0, name="grip")])
    run = mbdae.solve(mech, (0, 0.5))
    run.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz").signals()
    (state,) = mech.states
    np.testing.assert_array_equal(again[f"s.{state}"], run.y[:, -2])
    np.testing.assert_array_equal(again["work"], run.y[:, -1])
    assert np.ptp(again[f"s.{state}"]) > 0


def test_csv_is_the_table_of_signals(sol, tmp_path):
    sol.save(tmp_path / "run.csv")
    with (tmp_path / "run.csv").open() as file:
        names, *rows = csv.reader(file)
    signals = sol.signals()
    assert names == list(signals)
    np.testing.assert_array_equal(np.array(rows, float), np.column_stack(list(signals.values())))


def test_another_version_is_named(sol, tmp_path):
    sol.save(tmp_path / "run.npz")
    old = rewritten(tmp_path / "run.npz", tmp_path / "old.npz", versions={"mbdae": "0.0.7"})
    with pytest.warns(UserWarning, match=rf"mbdae 0\.0\.7.* mbdae {archive.versions()['mbdae']}"):
        assert len(mbdae.Solution.load(old).t) == len(sol.t)
    new = rewritten(tmp_path / "run.npz", tmp_path / "new.npz", versions={"mbdae": "9.0"}, format=3)
    with pytest.raises(InputError, match=r"mbdae 9\.0 in format 3"):
        mbdae.Solution.load(new)


def test_files_of_earlier_versions_open():
    """Written by mbdae 0.1.0 before mechanism files had units; the impacts by the same run now."""
    back = mbdae.Solution.load(DATA / "run_format_2.npz")
    now = mbdae.solve("slider_crank_with_stop", (0, 1.0), rtol=1e-10)
    np.testing.assert_allclose(back.q[-1], now.q[-1], atol=1e-4)
    assert len(back.impacts) == len(now.impacts) > 0
    assert mbdae.drift(back).g_max < 1e-10


def test_files_of_formats_that_are_not_read_are_rejected_by_name(sol, tmp_path):
    sol.save(tmp_path / "run.npz")
    old = rewritten(tmp_path / "run.npz", tmp_path / "old.npz", versions={"mbdae": "0.0.1"}, format=1)
    with pytest.raises(
        InputError, match=r"old\.npz was written by mbdae 0\.0\.1 in format 1; this is mbdae .* format 2"
    ):
        mbdae.Solution.load(old)


def test_a_damaged_file_is_one_clear_error(sol, tmp_path):
    good, bad = tmp_path / "run.npz", tmp_path / "bad.npz"
    sol.save(good)
    data = good.read_bytes()
    rng = np.random.default_rng(1)
    flipped = []
    for at in rng.integers(0, len(data), 40):
        copy = bytearray(data)
        copy[at] ^= 0xFF
        flipped.append(bytes(copy))
    cut = [data[:n] for n in (0, 1, 100, len(data) // 2, len(data) - 1)]
    messages = []
    with zipfile.ZipFile(good) as file, zipfile.ZipFile(bad, "w") as unclosed:
        for name in file.namelist():  # numpy parses the headers of arrays as Python
            unclosed.writestr(name, file.read(name).replace(b"), }", b"), ("))
    for text in [*cut, *flipped, bad.read_bytes(), b"PK\x03\x04 nonsense", b"plain text", np.arange(3.0).tobytes()]:
        bad.write_bytes(text)
        try:
            again = mbdae.Solution.load(bad)
        except InputError as e:
            messages.append(str(e))
        else:  # a bit that is never read, such as a file's date
            np.testing.assert_array_equal(again.y, sol.y)
    assert len(messages) > 30
    assert all("bad.npz is damaged" in m and "\n" not in m for m in messages)
    np.save(tmp_path / "array.npy", np.zeros(3))
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    short = rewritten(good, tmp_path / "short.npz", mechanism={"name": "x"})
    for path in ("array.npy", "other.npz", short.name):
        with pytest.raises(InputError, match=rf"{path} is damaged or not a solution"):
            mbdae.Solution.load(tmp_path / path)
    for name, change in (("t", sol.t[:, None]), ("y", sol.y.astype(str)), ("z_own", sol.z_own[1:])):
        with np.load(good) as file:
            np.savez(tmp_path / "edited.npz", **{**{n: file[n] for n in file.files}, name: change})
        with pytest.raises(InputError, match=r"edited\.npz is damaged"):
            mbdae.Solution.load(tmp_path / "edited.npz")
    with pytest.raises(InputError, match=r"missing key settings\.method"):
        mbdae.Solution.load(rewritten(good, tmp_path / "edited.npz", settings={}))
    with pytest.raises(InputError, match="no such file"):
        mbdae.Solution.load(tmp_path / "gone.npz")
    (tmp_path / "press.toml").write_text("source = 'press.urdf'")
    for other in (tmp_path, tmp_path / "press.toml"):
        with pytest.raises(InputError, match=r"not a solution .*expected a \.npz file, as .mbdae solve MODEL -o"):
            mbdae.Solution.load(other)


def test_files_are_written_whole_or_not_at_all(sol, tmp_path, monkeypatch):
    path = tmp_path / "run.csv"
    path.write_text("precious")

    def fail(self):
        raise InputError("no columns today")

    monkeypatch.setattr(mbdae.Solution, "signals", fail)
    with pytest.raises(InputError, match="no columns"):
        sol.save(path)
    assert path.read_text() == "precious"
    with pytest.raises(InputError, match=r"\.npz or \.csv, got"):
        sol.save(tmp_path / "run.pkl")
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]


def test_a_notebook_shows_the_replay(sol):
    page = sol._repr_html_()
    assert page.startswith("<iframe srcdoc=")
    assert "&lt;!DOCTYPE html&gt;" in page
    assert "pherk6" in repr(sol)
    assert len(repr(sol)) < 200
    textbook = mbdae.solve(hessenberg_a(), (0, 0.1))
    assert textbook._repr_html_().startswith("<div><strong>finished")


def test_versions_of_packages_are_read_once():
    """Their metadata take as long as a short run, and every file names them."""
    before = versions()
    reads = version_of.cache_info().misses
    assert versions() == before == {name: version(name) for name in before}
    assert version_of.cache_info().misses == reads
