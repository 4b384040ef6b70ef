"""Models shared by tests, since loading and assembling a model takes longer than many runs."""

from functools import cache

import mbdae


@cache
def shared_model(name):
    """Return a model of the library, for tests that change nothing of it."""
    return mbdae.load(name)
