"""Commands run in-process, and sample commands declared by the tests of studies."""

import ast
import gc
import re
import sys
import warnings
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from unittest import mock

import pytest

from mbdae.__main__ import main
from mbdae.cli import study_command
from mbdae.discovery import lazy_import


def call(*arguments, cwd="."):
    """Return exit code, standard output and standard error of `mbdae ARGUMENTS` in a folder."""
    out, err = StringIO(), StringIO()
    with (
        chdir(cwd),
        redirect_stdout(out),
        redirect_stderr(err),
        mock.patch.object(sys, "argv", ["mbdae", *map(str, arguments)]),
        mock.patch.object(gc, "set_threshold"),  # its threshold for one command would keep garbage of all tests
        warnings.catch_warnings(action="default", category=UserWarning),  # main() sets how warnings are shown
        pytest.raises(SystemExit) as stop,
    ):
        main()
    return stop.value.code, out.getvalue(), err.getvalue()


def without_pictures(patch):
    """Skip the pictures of reports, which a test does not read."""
    patch.setattr("mbdae.studies.fit.page.image", lambda *_, **__: "")  # first: it keeps a reference
    for name in ("posture", "motion", "drifts", "convergence", "work_precision", "image"):
        patch.setattr(f"mbdae.studies.report.page.{name}", lambda *_, **__: "")


def without_layout(patch):
    """Skip the layout of figures, for tests of their data."""
    patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)


def keep_studies(patch, results, known=False):
    """Append the results of studies that commands call to a list; if known, return those in the list."""

    def find(module, name):
        study = lazy_import(module, name)

        def called(*arguments, **options):
            if known:
                return results.pop(0)
            results.append(study(*arguments, **options))
            return results[-1]

        return called

    patch.setattr(study_command, "lazy_import", find)


def sample_commands():
    """Return all ``COMMANDS = (...)`` of the tests of studies, which run after `mbdae solve MODEL -o run.npz`."""
    texts = [path.read_text() for path in sorted((Path(__file__).parent / "studies").rglob("test_*.py"))]
    matches = [re.search(r"^COMMANDS = (\(.*?\))$", text, re.M | re.S) for text in texts]
    return [command for match in matches if match for command in ast.literal_eval(match[1])]
