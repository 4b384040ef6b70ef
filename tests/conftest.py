"""What all tests share: children that can be stopped and import what is installed, and which back end computes."""

import os
import signal
import warnings

from mbdae import backend

signal.signal(
    signal.SIGINT, signal.default_int_handler
)  # a shell switches Ctrl-C off in what it runs in the background
os.environ["PYTHONSAFEPATH"] = "1"  # children import the installed mbdae, not a source tree they are started in

if backend.load() is None:  # said in the header, not by a warning that fails the first test to run a simulation
    os.environ["PYTHONWARNINGS"] = f"ignore:{backend.SLOW}"
    with warnings.catch_warnings(action="ignore"):
        backend.choose("auto")


def pytest_report_header():
    """The line of `mbdae info`."""
    return f"mbdae: {backend.status()}"
