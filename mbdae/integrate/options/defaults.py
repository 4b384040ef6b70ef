"""Default settings of a run, used where neither its arguments nor the mechanism file specify them."""

from math import inf
from typing import Any

DEFAULTS: dict[str, Any] = {
    "method": "pherk6",
    "formulation": "index2",
    "project": "auto",
    "baumgarte": None,
    "step": None,
    "rtol": 1e-8,  # default of all runs, in Python, on the command line and in studies; see examples/guide/methods.md
    "atol": None,
    "first_step": None,
    "max_step": inf,
    "max_steps": None,
}
