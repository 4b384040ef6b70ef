"""Invalid input of a fit: tables, files, options; and failing user functions."""

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError, MbdaeError, UnknownNameError

DATA = {"t": [0.1, 0.2, 0.3], "q.crank": [1.2, 1.1, 1.0]}
RANGE = {"gravity.2": (-12, -8)}
STEP = {"step": 0.02, "method": "pherk5"}


def fit(data=DATA, parameters=RANGE, model="four_bar", **options):
    return mbdae.fit(model, parameters, data, **STEP, **options)


OPTIONS = [
    ({"spans": "a"}, InputError, "fractions of the samples between 0 and 1, got 'a'"),
    ({"spans": ["a"]}, InputError, "fractions of the samples between 0 and 1"),
    ({"spans": (1j,)}, InputError, "fractions of the samples between 0 and 1"),
    ({"spans": (np.nan,)}, InputError, "fractions of the samples between 0 and 1"),
    ({"spans": (True,)}, InputError, "fractions of the samples between 0 and 1"),
    ({"span": (0, 1)}, UnknownNameError, r"unknown setting of solve 'span'; valid: q, v, s, method"),
    ({"starts": True}, InputError, "starts is a number of searches"),
    ({"progress": 3}, InputError, "progress is a function of a text, got 3"),
    ({"progress": lambda: None}, InputError, "progress failed: TypeError"),
    ({"known": {3: 1.0}}, InputError, "known parameters have dotted names, got 3"),
    ({"known": {"start.q.crank": np.nan}}, InputError, r"start\.q\.crank"),
    ({"known": {"nothing": 1.0}}, UnknownNameError, "nothing"),
    ({"known": {"joint.crank.mass": 1j}}, InputError, "a parameter takes numbers, texts or lists of numbers, got 1j"),
    ({"parameters": {3: (0, 1)}}, InputError, "parameters have dotted names, .* got 3"),
    ({"sigma": -1.0}, InputError, "noise level of 'q.crank'"),
    ({"sigma": np.nan}, InputError, "noise level of 'q.crank'"),
    ({"sigma": [1.0]}, InputError, "noise level of 'q.crank'"),
    ({"sigma": {"q.crank": 1.0, "q.crnk": 1.0}}, UnknownNameError, r"measured signal in sigma 'q\.crnk'.*; valid: q"),
    ({"signals": 3}, InputError, "signals are names of columns, got 3"),
    ({"t_span": (1, 0)}, InputError, "is outside the span"),
    ({"model": 3}, InputError, "a model is a Mechanism, a name, a path, tables or a function that returns one, got 3"),
    ({"model": "nothing"}, UnknownNameError, "unknown model 'nothing'"),
]


@pytest.mark.parametrize(("options", "error", "words"), OPTIONS)
def test_what_is_no_option(options, error, words):
    with pytest.raises(error, match=words):
        fit(**options)


TABLES = [
    ([], "a fit needs data"),
    (None, "expected a table of t and signals"),
    ({"t": [], "q.crank": []}, "no signal has a value"),
    ({"t": [0.1, 0.1], "q.crank": [1, 1]}, "times must increase"),
    ({"t": [0.1, np.nan], "q.crank": [1, 1]}, "times must increase"),
    ({"t": [-np.inf, 0.1], "q.crank": [1, 1]}, "times must increase"),
    ({"t": [0.1], "q.crank": [np.nan]}, "no signal has a value"),
    ({"t": [0.1], "q.crank": [1j]}, "not a table of numbers: expected real numbers, got complex128"),
    ({"t": [0.1], "q.crank": [True]}, "not a table of numbers: expected real numbers, got bool"),
    ({"t": np.array(["2020-01-01"], "M8[D]"), "q.crank": [1]}, r"expected real numbers, got datetime64\[D\]"),
    ({"t": [0.1], "q.crank": ["a"]}, "not a table of numbers"),
    ({"t": [0.1], "q.crank": [1e300]}, r"column 'q\.crank' has a value beyond 1e\+150"),
    ({"t": [0.1, 0.2], "q.crank": [1]}, "signals of its length"),
    ({"t": [[0.1]], "q.crank": [[1]]}, "signals of its length"),
    ({"time": [0.1], "q.crank": [1]}, "no column 't' of times, only time, q.crank"),
    ({"t": [0.0], "q.crank": [1]}, "no time passes"),
    ({"t": [0.1], 3: [1]}, "unknown signal '3'"),
]


@pytest.mark.parametrize(("table", "words"), TABLES)
def test_what_is_no_table(table, words):
    with pytest.raises(InputError, match=words):
        fit(table)


FILES = [
    ("", "a line of names and lines of numbers"),
    ("t,q.crank\n", "a line of names and lines of numbers"),
    ("t,q.crank\n\n\n", "a line of names and lines of numbers"),
    ("t,q.crank\ns,rad\n0.1,1\n", "line 2: 's' is not a number"),
    ("t,q.crank\n0.1\n", "line 2: 1 values under 2 names"),
    ("t,q.crank,q.crank\n0.1,1,1\n", "two columns are named 'q.crank'"),
    ("t;q.crank\n0.1;1\n", r"separated by commas, decimals by points, got the line 't;q\.crank'"),
    ("t,q.crank [m]\n0.1,1\n", "column 'q.crank' is in 'm', valid: rad, mrad, deg, rev"),
    ("t [rpm],q.crank\n0.1,1\n", "column 't' is in 'rpm', valid: s, ms, min, h"),
    ("t,v.crank [N mm/kg]\n0.1,1\n", "column 'v.crank' is in 'N mm/kg', valid: rad/s, rpm"),
    ("t,q.crank\n0.2,1\n0.1,1\n", "times must increase"),
    ("t,q.crank\n,1\n0.1,1\n", "times must increase"),
    ("t,q.crank\n0.1,inf\n", "'q.crank' has an infinite value"),
    ("0.1,1.0\n0.2,1.1\n", "no column 't' of times, only 0.1, 1.0"),
    ("t,angle\n0.1,1.0\n", "unknown signal 'angle'"),
    ("\x00\x01", "a line of names and lines of numbers"),
]


@pytest.mark.parametrize(("text", "words"), FILES)
def test_what_is_no_file(text, words, tmp_path):
    """From Python and from the command."""
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        fit(str(path))
    said = CliRunner().invoke(cli, ["fit", "four_bar", str(path), "-p", "gravity.2=-12:-8", "--step", "0.02"])
    assert isinstance(said.exception, InputError), "which `mbdae` prints in one line"


@pytest.mark.parametrize(
    ("columns", "words"),
    [({"a": [1.0]}, "no column 't' of times, only a"), ({"t": [0.1], "q.crank": ["a"]}, "could not convert"),
     ({"t": [0.1], "q.crank": [[1.0, 2.0]]}, "signals of its length|cannot be read"), ({}, "only nothing")],
)  # fmt: skip
def test_what_is_no_parquet_file(columns, words, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    import pyarrow

    parquet.write_table(pyarrow.table(columns), tmp_path / "data.parquet")
    with pytest.raises(InputError, match=words):
        fit(tmp_path / "data.parquet")


def test_a_model_that_fails_is_the_cause():
    def broken(gravity):
        raise ValueError("no gravity")

    with pytest.raises(MbdaeError, match=r"model 'broken' failed at gravity = -10\.0: ValueError: no") as found:
        fit(model=broken, parameters={"gravity": (-12, -8)})
    assert isinstance(found.value.__cause__, ValueError)
    with pytest.raises(UnknownNameError, match=r"unknown parameter of broken 'mass'.*valid: gravity"):
        fit(model=broken, parameters={"mass": (0, 1)})


def test_a_fit_ends_when_the_user_stops_a_run():
    """A run stopped by the user is not a failed run."""
    calls = []

    def torque(t, q, v):
        calls.append(t)
        if len(calls) == 200:
            raise KeyboardInterrupt
        return np.zeros(3)

    with pytest.raises(KeyboardInterrupt):
        fit(model=mbdae.load("four_bar", forces=[torque]))
    assert len(calls) == 200


def test_a_force_that_fails_is_named_with_the_parameters():
    def torque(t, q, v):
        if t < 0.05:
            return np.zeros(3)
        raise ValueError("no torque")

    with pytest.raises(InputError, match=r"data 1: with gravity\.2 = -9\.81, .*'torque' failed at .*ValueError: no"):
        fit(model=mbdae.load("four_bar", forces=[torque]))
