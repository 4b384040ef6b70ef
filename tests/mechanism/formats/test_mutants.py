"""A few mutants of every kind of file; ``python tests/fuzzing.py --count 3000`` tries many more."""

import os

import pytest
from fuzzing import Mutants, hunt

FEW = int(os.environ.get("MBDAE_MUTANTS", "4"))


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("kind", Mutants.KINDS)
def test_files_with_mistakes_are_read_or_refused_in_one_line(kind):
    if kind in ("mjcf", "replicated", "saved"):
        pytest.importorskip("mujoco", reason="mujoco is not installed")
    wrong, answers = hunt([kind], FEW)
    assert not wrong
    assert sum(answers.values()) == FEW
