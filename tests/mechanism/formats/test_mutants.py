"""A few mutants of every kind of file; ``python tests/fuzzing.py --count 3000`` tries many more."""

import os
from contextlib import closing

import pytest
from fuzzing import Child, Mutants, try_mutants

FEW = int(os.environ.get("MBDAE_MUTANTS", "4"))


@pytest.fixture(scope="module")
def worker():
    """One process for all kinds of files: it imports for longer than it reads."""
    with closing(Child()) as child:
        yield child


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("kind", Mutants.KINDS)
def test_files_with_mistakes_are_read_or_rejected_in_one_line(kind, worker):
    if kind in ("mjcf", "replicated", "saved"):
        pytest.importorskip("mujoco", reason="mujoco is not installed")
    assert not try_mutants(worker, [kind], FEW)[0]
