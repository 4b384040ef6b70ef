"""Kinds of the elements that Python adds to a mechanism."""

from collections.abc import Sequence

from ..errors import require
from .closures.closure import Closure
from .closures.clutch import Clutch
from .closures.driver import Driver
from .closures.unilateral_constraint import Stop
from .hybrid.reset import Reset

KINDS = {"closures": Closure, "drivers": Driver, "stops": Stop, "clutches": Clutch, "resets": Reset}


def require_elements(**elements: Sequence[object]) -> None:
    """Check lists of closures, drivers, stops, clutches and resets, each by the name of its argument.

    Raises:
        InputError: for anything other than a list, or an element of another kind.
    """
    for name, values in elements.items():
        what = f"{name} are a list of mbdae.{KINDS[name].__name__}"
        require(values, Sequence, what)
        for element in values:
            require(element, KINDS[name], what)
