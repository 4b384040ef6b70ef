"""Setup of all tests: child processes can be stopped and import the installed package; fixtures for back ends."""

import gc
import multiprocessing
import os
import signal
import warnings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # pytest's workers share the cores: their threads only wait

import pytest

from mbdae import Mechanism, backend
from mbdae.integrate.run import run_setup
from mbdae.studies import workers

signal.signal(
    signal.SIGINT, signal.default_int_handler
)  # a shell disables Ctrl-C for background jobs
os.environ["PYTHONSAFEPATH"] = "1"  # children import the installed mbdae, not the source tree of the working directory

if backend.load() is None:  # reported in the header; a warning would fail the first test that runs a simulation
    os.environ["PYTHONWARNINGS"] = f"ignore:{backend.SLOW_WARNING}"
    with warnings.catch_warnings(action="ignore"):
        backend.select_core("auto")


def pytest_report_header():
    """Return the line of `mbdae info`."""
    return f"mbdae: {backend.status()}"


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Exclude the ten thousand tests, which live to the end, from garbage collections."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(10_000, 20, 20)  # of a test, nearly all is freed without a search, which took 4 % of the time
        gc.enable()


def pytest_sessionfinish():
    gc.unfreeze()


@pytest.fixture(params=["native", "python"])
def back_end(request, monkeypatch):
    """Run a test on both back ends: runs and, by `Mechanism.system()`, single evaluations and steps."""
    core, system = backend.select_core(request.param) if backend.load() else None, Mechanism.system

    def bound(self, *args, **named):
        return system(self, *args, **named) if core is None or args or named else system(self, native=core)

    monkeypatch.setattr(run_setup, "select_core", lambda asked: core if asked == "auto" else backend.select_core(asked))
    monkeypatch.setattr(Mechanism, "system", bound)
    return request.param


@pytest.fixture
def forked_workers(monkeypatch):
    """Fork worker processes from one that has imported mbdae: importing takes new ones seconds (`test_workers`)."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["mbdae.studies.comparison.compare", "mbdae.studies.sweep.sweep"])
    monkeypatch.setattr(workers, "get_context", lambda _: context)


def pytest_collection_modifyitems(items):
    """Skip tests that need the core if it is missing."""

    def given(item):
        return getattr(getattr(item, "callspec", None), "params", {})

    if backend.load() is None:
        for item in items:
            if item.get_closest_marker("native") or "native" in map(str, given(item).values()):
                item.add_marker(pytest.mark.skip(reason=backend.status()))
