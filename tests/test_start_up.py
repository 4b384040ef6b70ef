"""Modules that are loaded before the end of a first run."""

import subprocess
import sys

import pytest

RUN = """
import sys
import mbdae
assert mbdae.solve("four_bar", (0, 0.1)).success
print(sorted({name.split(".")[0] for name in sys.modules} & {"scipy", "matplotlib", "meshcat", "mujoco"}))
"""


@pytest.mark.native
def test_a_run_in_the_core_loads_neither_scipy_nor_figures():
    done = subprocess.run([sys.executable, "-c", RUN], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
