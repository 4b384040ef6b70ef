"""Startup time: completion, versions and help come without numpy or Pinocchio."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete

import mbdae
from mbdae.__main__ import cli
from mbdae.cli import completion
from mbdae.mechanism.mechanism import SYSTEMS
from mbdae.methods import EXPLICIT, METHODS
from mbdae.studies.method_variant import FORMULATIONS
from mbdae.studies.schema.schema import FILES
from mbdae.studies.statics import equilibrium
from mbdae.textbook.problems import TEXTBOOK

HEAVY = {"numpy", "scipy", "pinocchio", "pydantic", "matplotlib", "meshcat", "rich"}
PROGRAM = """
import contextlib, io, json, os, sys
from mbdae.__main__ import main
sys.argv[0] = "mbdae"
said = []
for arguments, environment in json.loads(sys.argv.pop()):
    os.environ.update(environment)
    sys.argv[1:] = arguments
    out = io.TextIOWrapper(io.BytesIO())
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        main()
    out.flush()
    said.append(out.buffer.getvalue().decode())
    for name in environment:
        del os.environ[name]
print(json.dumps([said, sorted({name.partition(".")[0] for name in sys.modules})]))
"""
HELP = [(["--version"], mbdae.__version__), (["--help"], "Simulate a model"), (["solve", "-h"], "--rtol")]
TYPED = [
    ("sol", ["solve"]),
    ("solve slid", ["slider_crank"]),
    ("solve --for", ["--formulation"]),
    ("solve --formulation in", ["index1", "index2"]),
    ("order pendulum -m herk", ["herk1", "herk2", "herk3", "herk4", "herk5"]),
    ("drift fek", ["fekete"]),
]


def asked(shell, typed):
    """The environment in which a shell asks for completions."""
    *before, last = ["mbdae", *typed.split()]
    word = str(len(before)) if shell == "zsh" else last
    return {"COMP_WORDS": " ".join([*before, last]), "COMP_CWORD": word, "_MBDAE_COMPLETE": f"{shell}_complete"}


def imported(*calls):
    """The outputs of calls of mbdae with arguments and an environment, and the packages that they import."""
    command = [sys.executable, "-c", PROGRAM, json.dumps(calls)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    said, packages = json.loads(done.stdout)
    return said, set(packages)


def test_help_and_version_import_no_numbers():
    said, packages = imported(*((arguments, {}) for arguments, _ in HELP))
    for out, (_, word) in zip(said, HELP, strict=True):
        assert word in out
    assert "click" in packages
    assert not packages & HEAVY


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_completion_imports_no_numbers(shell):
    said, packages = imported(*(([], asked(shell, typed)) for typed, _ in TYPED))
    for out, (_, words) in zip(said, TYPED, strict=True):
        assert sorted({*re.split(r"[,\t\n]", out)} & {*words}) == words, out
    assert "click" in packages
    assert not packages & HEAVY


def test_the_list_of_models_loads_none():
    (out,), packages = imported((["models"], {}))
    assert "Planar four-bar linkage" in out
    assert packages & HEAVY == {"rich"}


@pytest.mark.slow
def test_runs_without_curves_events_and_modes_import_little_of_scipy():
    program = """import sys, mbdae
mbdae.solve(mbdae.load("pendulum"), (0, 0.1))
print(*{f"scipy.{x}" for x in ("interpolate", "optimize", "integrate", "sparse", "special")} & set(sys.modules))"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "\n"


def suggested(*words):
    """Completions of the last of some words; files are left to the shell."""
    found = ShellComplete(cli, {}, "mbdae", "_MBDAE_COMPLETE").get_completions(list(words[:-1]), words[-1])
    return [item.value for item in found if item.type == "plain"]


def test_every_name_is_completed():
    assert completion.methods() == sorted({*METHODS, *EXPLICIT})
    assert suggested("solve", "-m", "") == suggested("compare", "pendulum", "-m", "") == completion.methods()
    assert suggested("view", "") == mbdae.model_names()
    assert suggested("info", "") == suggested("solve", "")
    assert suggested("solve", "") == suggested("drift", "") == [*mbdae.model_names(), *sorted(TEXTBOOK)]
    assert set(suggested("solve", "--formulation", "")) == set(SYSTEMS)
    assert set(suggested("compare", "--formulation", "")) < set(FORMULATIONS)
    assert suggested("schema", "") == list(FILES)
    assert suggested("equilibrium", "pendulum", "--find", "") == list(equilibrium.FIND)


def test_words_in_lists_and_after_formulations_are_completed():
    assert suggested("compare", "pendulum", "-m", "herk5,arn") == ["herk5,arnold4"]
    radau = ["ggl:radau1", "ggl:radau3", "ggl:radau5", "ggl:radau_ia2"]
    assert suggested("compare", "pendulum", "-m", "ggl:rad") == radau


def test_a_model_may_be_a_file():
    found = ShellComplete(cli, {}, "mbdae", "_MBDAE_COMPLETE").get_completions(["solve"], "./mod")
    assert [(item.type, item.value) for item in found] == [("file", "./mod")]


@pytest.mark.parametrize(("typed", "word"), [("solve four_", "four_bar"), ("order pendulum -m arn", "arnold4")])
def test_bash_itself_completes_names_where_files_may_be_given(typed, word, tmp_path):
    bash = shutil.which("bash") or pytest.skip("no bash found")
    program = tmp_path / "mbdae"
    program.write_text(f"#!{sys.executable}\nfrom mbdae.__main__ import main\nmain()\n")
    program.chmod(0o755)
    words = ["mbdae", *typed.split()]
    script = f"""eval "$(_MBDAE_COMPLETE=bash_source mbdae)"
        COMP_WORDS=({" ".join(words)}); COMP_CWORD={len(words) - 1}
        _mbdae_completion mbdae {words[-1]} {words[-2]} 2>/dev/null
        echo "${{COMPREPLY[@]}}" """
    paths = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "PYTHONPATH": str(Path(mbdae.__file__).parents[1])}
    out = subprocess.run([bash, "-c", script], capture_output=True, text=True, env={**os.environ, **paths}, check=True)
    assert out.stdout.split() == [word]
