"""Long computations without a terminal for a progress bar: one line on stderr."""

import sys

import pytest

from mbdae import progress_bar


@pytest.fixture
def at(monkeypatch, capsys):
    """Report a fraction at a time in s, and return what stderr has then."""
    clock = [0.0]
    monkeypatch.setattr("mbdae.progress.monotonic", lambda: clock[0])
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    with progress_bar("pherk6") as report:

        def tell(t, done):
            clock[0] = t
            report(done)
            return capsys.readouterr().err

        yield tell


def test_a_run_that_will_take_hours_says_so_once(at):
    """At 1e-4 a second, 1e4 s are needed."""
    assert at(1.0, 1e-4) == ""
    assert at(11.0, 1.1e-3) == "pherk6: 0.11 % after 11 s, about 1e+04 s are left\n"
    assert at(30.0, 3e-3) == ""


def test_a_run_that_will_soon_be_over_says_nothing(at):
    assert at(20.0, 0.5) == at(30.0, "a name") == at(31.0, 1.0) == ""
