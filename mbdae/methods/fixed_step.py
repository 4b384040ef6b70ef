"""Methods with fixed steps alone, computed in Python."""

from .alpha import GeneralizedAlpha
from .variational import Composition

FIXED_STEP = Composition, GeneralizedAlpha
