"""Figures for LaTeX: .pgf, with the fonts of the document; a missing LaTeX is named."""

import re
import sys

import pytest
from test_figures import comparison

from mbdae.cli.output import writable
from mbdae.errors import InputError
from mbdae.file_io import PICTURE_SUFFIXES
from mbdae.studies import figures
from mbdae.studies.comparison.figure import work_precision

LATEX = r"""#!{python}
import sys
for line in sys.stdin:  # the part of LaTeX that matplotlib asks for the sizes of texts
    if "pgf_backend_query_start" in line: print("*pgf_backend_query_start\n\n*", end="", flush=True)
    if "impossible" in line: sys.exit(1)
    if r"\the\dp0" in line: print("20.0pt,6.0pt,1.5pt\n\n*", end="", flush=True)
"""


@pytest.fixture
def latex(tmp_path, monkeypatch):
    """A program that answers like LaTeX, and no other one."""
    program = tmp_path / "bin" / "lualatex"
    program.parent.mkdir()
    program.write_text(LATEX.replace("{python}", sys.executable))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent))


@pytest.mark.usefixtures("latex")
def test_a_figure_has_the_fonts_of_the_document(tmp_path):
    figure = work_precision(comparison())
    paths = [tmp_path / f"{name}.pgf" for name in "ab"]
    for path in paths:
        figures.save(figure, path)
    text = paths[0].read_text("utf-8")
    assert text.startswith("%% Creator: Matplotlib, PGF backend")
    assert "setmainfont" not in text
    for ax in figure.axes:
        assert re.sub(r"[\W\d_]+.*", "", ax.get_xlabel()) in text
    assert paths[1].read_text("utf-8") == text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.pgf", "b.pgf", "bin"]


@pytest.mark.usefixtures("latex")
def test_texts_that_latex_cannot_set_are_named(tmp_path):
    figure = figures.empty_figure(2.0, 2.0)
    figure.text(0.5, 0.5, "impossible")
    with pytest.raises(InputError, match=r"^lualatex cannot measure the texts of a \.pgf figure: Error measuring .*$"):
        figures.save(figure, tmp_path / "a.pgf")
    assert not list(tmp_path.glob("*.pgf"))


def test_without_latex(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    words = r"and none of xelatex, lualatex, pdflatex is installed: install one, or save as \.pdf or \.svg$"
    with pytest.raises(InputError, match=words):
        comparison().plot(tmp_path / "a.pgf")
    with pytest.raises(InputError, match=words):
        writable((str(tmp_path / "a.pgf"), PICTURE_SUFFIXES))  # of a command, before it computes
    assert not list(tmp_path.iterdir())
