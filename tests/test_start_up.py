"""Modules that are loaded, and options and schemas that are made, before the end of a first run or of help."""

import subprocess
import sys

import pytest

UNUSED = ["matplotlib", "mbdae.mechanism.appearance", "meshcat", "mujoco", "numpy.ma", "rich", "scipy", "yaml"]
RUN = f"""
import sys
import mbdae
assert mbdae.solve("four_bar", (0, 0.1)).success
print(sorted(set(sys.modules) & set({UNUSED})), mbdae._modules_of_names.cache_info().misses)
"""
COMMAND = f"""
import sys
from mbdae.__main__ import cli
cli(["solve", *sys.argv[1:]], standalone_mode=False)
from mbdae.mechanism.closures.closure import Closure, kinds_of
loaded = [name.partition("closures.kinds.")[2] for name in sys.modules if "closures.kinds." in name]
commands = [name for name in sys.modules if name.startswith("mbdae.studies.") and name.endswith(".command")]
built = [kind for kind, c in kinds_of(Closure).items() if c.__pydantic_complete__]
print(sorted(set(sys.modules) & set({UNUSED})), *commands, *built, *sorted(loaded))
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
GARBAGE = """
import atexit, gc, sys
from mbdae.__main__ import main
before = [generation["collections"] for generation in gc.get_stats()]
atexit.register(lambda: print([x["collections"] for x in gc.get_stats()] == before, gc.get_freeze_count() > 50_000))
main()
"""


def last_line(program, *arguments):
    done = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1]


@pytest.mark.native
def test_a_run_in_the_core_loads_nothing_that_it_does_not_use_and_searches_no_files_for_names():
    assert last_line(RUN) == "[] 0"


@pytest.mark.native
@pytest.mark.parametrize(("model", "kind"), [("slider_crank", "revolute"), ("spring_four_bar", "point")])
def test_a_saved_run_loads_nothing_else_and_builds_the_kinds_of_its_model(model, kind, tmp_path):
    """The slider-crank starts with projected velocities, the least change in the mass metric."""
    assert last_line(COMMAND, model, "-t", "0.5", "-o", str(tmp_path / "run.npz")) == (
        f"[] mbdae.studies.solve.command {kind} {kind} rolling"
    )


@pytest.mark.native
def test_a_saved_run_searches_no_garbage(tmp_path):
    """Neither while modules are imported nor at the end of Python."""
    assert last_line(GARBAGE, "solve", "slider_crank", "-t", "0.5", "-o", str(tmp_path / "run.npz")) == "True True"


@pytest.mark.parametrize(("asked", "made"), [(["-h"], ""), (["solve", "-h"], "solve")])
def test_help_makes_the_options_of_no_other_command(asked, made):
    assert last_line(HELP, *asked) == made
