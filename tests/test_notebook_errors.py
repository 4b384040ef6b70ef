"""A mistake in a notebook: the message in one line, above the lines of the cell that led to it."""

import re

import pytest

interactiveshell = pytest.importorskip("IPython.core.interactiveshell", reason="IPython is not installed")


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("mbdae.load('four_bra')", "UnknownNameError: unknown model 'four_bra' (did you mean 'four_bar'?)"),
        ("def run():\n    return mbdae.solve('four_bar', (0, 1), rtol=-1)\n\nrun()", "InputError: rtol"),
    ],
)
def test_a_mistake_is_one_line_above_a_short_traceback(cell, said, capsys):
    shell = interactiveshell.InteractiveShell()
    shell.run_cell(f"import mbdae\n{cell}")
    first, *rest = re.sub(r"\x1b\[[\d;]*m", "", capsys.readouterr().out).strip().splitlines()
    assert first.startswith(said)
    assert len(rest) <= 6
    assert any(cell.splitlines()[-1] in line for line in rest)
    assert not any("mbdae/" in line for line in rest)
