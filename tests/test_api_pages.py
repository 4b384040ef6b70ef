"""The pages of the API: pdoc makes them from docstrings, of every public name and without a warning."""

import re
import subprocess
import sys

import pytest

import mbdae


def test_pages_are_made_of_all_public_names(tmp_path):
    pytest.importorskip("pdoc")
    command = [sys.executable, "-W", "error::UserWarning", "-m", "pdoc", "-d", "google", "-o", str(tmp_path), "mbdae"]
    command += ["--no-show-source", "--no-search"]  # colouring the source code takes half of the time
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    sections = re.findall(r'<section id="(\w+)">', (tmp_path / "mbdae.html").read_text("utf-8"))
    assert set(sections) == set(mbdae.__all__)
