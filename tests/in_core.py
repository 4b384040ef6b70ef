"""Models that the compiled core runs: all except those with features that it lacks."""

import mbdae
from mbdae import backend
from mbdae.errors import NotCompiled


def _compiles(name):
    try:
        return bool(mbdae.load(name).system(native=backend.load()))
    except NotCompiled:
        return False


IN_CORE = [name for name in mbdae.model_names() if _compiles(name)]
