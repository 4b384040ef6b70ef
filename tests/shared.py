"""Models that tests share, since loading and assembling one takes longer than many of the runs."""

from functools import cache

import mbdae


@cache
def shared_model(name):
    """A model of the library, for tests that change nothing of it."""
    return mbdae.load(name)
