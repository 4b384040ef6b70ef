"""Models whose runs the compiled core supports."""

from smooth import MODELS

from mbdae import backend
from mbdae.errors import NotCompiled


def _compiles(mech):
    try:
        return bool(mech.system(native=backend.load()))
    except NotCompiled:
        return False


IN_CORE = [name for name, mech in MODELS.items() if _compiles(mech)]
