"""The README's code runs, its tables agree with the code, and its commands work."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.mechanism.closures.closure import KINDS
from mbdae.mechanism.forces.force import FORCES
from mbdae.mechanism.formats.library import MECHANISM, PARAMETRIC, SOURCES

README = (Path(__file__).parent.parent / "README.md").read_text()
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.S)
PYTHON = [code for language, code in BLOCKS if language == "python"]


def table(header: str) -> dict[str, list[str]]:
    body = README.split(f"| {header} |")[1].split("\n\n")[0].splitlines()[2:]
    rows = [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in body]
    return {row[0]: row[1:] for row in rows}


@pytest.mark.parametrize("code", PYTHON)
def test_python(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})


def test_commands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for language, code in BLOCKS:
        if language == "toml" and (name := re.match(r"# (\S+\.toml)\n", code)):
            (tmp_path / name[1]).write_text(code)
    for language, code in BLOCKS:
        if language == "python" and ".npz" in code:  # what it saves stands in the way of the commands behind it
            exec(compile(code, "README.md", "exec"), {})
        for line in code.splitlines() if language == "sh" else ():
            command = line.split("#")[0].split("&&")[-1].strip()
            if command.startswith("mbdae "):
                result = CliRunner().invoke(cli, shlex.split(command)[1:])
                assert result.exit_code == 0, (command, result.output, result.exception)


@pytest.mark.parametrize("command", re.findall(r"`(mbdae [^`-]+ -[^`]+)`", README.replace("\n", " ")))
def test_commands_within_sentences_are_complete(command):
    name, *words = shlex.split(command)[1:]
    cli.commands[name].make_context(name, words)


def test_the_mechanism_with_parameters_moves(tmp_path):
    (tmp_path / "tower.py").write_text(next(code for code in PYTHON if code.startswith("def mechanism")))
    sol = mbdae.solve(mbdae.load(tmp_path / "tower.py", floors=3), (0, 1))
    assert np.abs(np.diff(sol.q[[0, -1]], axis=0)).max() > 0.1


def test_methods_table():
    assert table("method") == {n: [str(m.order), m.title] for n, m in mbdae.METHODS.items()}


def test_models_table():
    assert table("model") == {n: [mbdae.load(n).title] for n in mbdae.model_names()}


def test_closures_table():
    found = table("closure")
    assert list(found) == list(KINDS)
    for kind, (rows, what) in found.items():
        assert int(rows) == mbdae.load(Path(__file__).parent / "data" / "closures" / f"{kind}.toml").ng
        assert what in mbdae.Closure.__doc__.replace("``", "`"), f"README and docstring say different things of {kind}"


def test_files_table():
    read = [suffix.strip(" `") for row in table("file") for suffix in row.split(",")]
    assert read == [MECHANISM, PARAMETRIC, *SOURCES]


def test_forces_table():
    assert list(table("force")) == [f.model_fields["kind"].default for f in FORCES]
