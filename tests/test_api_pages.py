"""The pages of the API: pdoc makes them from docstrings, of every public name and without a warning."""

import re
import warnings

import pytest

import mbdae


def test_pages_are_made_of_all_public_names(tmp_path, capsys, monkeypatch):
    pdoc = pytest.importorskip("pdoc")
    # colouring the source code takes half of the time
    pdoc.render.configure(docformat="google", show_source=False, search=False)
    monkeypatch.chdir(tmp_path)  # not a clone, whose folder has the name of the module
    with warnings.catch_warnings(action="error", category=UserWarning):
        pdoc.pdoc("mbdae", output_directory=tmp_path)
    assert capsys.readouterr() == ("", "")
    sections = re.findall(r'<section id="(\w+)">', (tmp_path / "mbdae.html").read_text("utf-8"))
    assert set(sections) == set(mbdae.__all__)
