"""Modules that are loaded, and options that are made, before the end of a first run or of help."""

import subprocess
import sys

import pytest

RUN = """
import sys
import mbdae
assert mbdae.solve("four_bar", (0, 0.1)).success
print(sorted({name.split(".")[0] for name in sys.modules} & {"scipy", "matplotlib", "meshcat", "mujoco"}))
"""
HELP = """
import sys
from mbdae.__main__ import cli
try:
    cli(sys.argv[1:])
except SystemExit:
    pass
made = [name for name, command in cli.commands.items() if "params" in vars(command)]
print(*{"importlib.metadata", "tempfile"} & set(sys.modules), *{"compare", "solve", "sweep"} & set(made))
"""


def last_line(program, *arguments):
    done = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1]


@pytest.mark.native
def test_a_run_in_the_core_loads_neither_scipy_nor_figures():
    assert last_line(RUN) == "[]"


@pytest.mark.parametrize(("asked", "made"), [(["-h"], ""), (["solve", "-h"], "solve")])
def test_help_makes_the_options_of_no_other_command(asked, made):
    assert last_line(HELP, *asked) == made
