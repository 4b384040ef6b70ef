"""Mechanisms with a parameter changed by the steps of a difference stencil."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from ...errors import InputError, MbdaeError
from ...finite_differences import ABOVE, BELOW, MAX_REDUCTIONS, REDUCTION, STENCIL

if TYPE_CHECKING:
    from ..mechanism import Mechanism

# k of changes k h whose mechanisms must exist; with k = 0 they test whether values are quadratic in the parameter
TRIAL_POINTS = {STENCIL: (-3, 1, 3), ABOVE: (2, 4, 6), BELOW: (-2, -4, -6)}


class PerturbedMechanisms(Mapping[int, "Mechanism"]):
    """Mechanisms with a parameter changed by k h, for the k of a difference stencil, created on demand."""

    def __init__(self, make: Callable[[float], "Mechanism"], h: float, stencil: tuple[int, ...]) -> None:
        self.make, self.h, self.stencil = make, h, stencil

    def __getitem__(self, k: int) -> "Mechanism":
        return self.make(k * self.h)

    def __iter__(self) -> Iterator[int]:
        return iter(self.stencil)

    def __len__(self) -> int:
        return len(self.stencil)


def perturbed_mechanism(
    make: Callable[[Mapping[str, float]], "Mechanism"],
    values: Mapping[str, float],
    name: str,
    value: float,
    delta: float,
) -> "Mechanism":
    """Return the mechanism with one parameter changed.

    Raises:
        InputError: if the changed value is outside its valid range.
    """
    try:
        return make({**values, name: value + delta})
    except MbdaeError as e:
        text = f"parameter {name!r} = {value:.9g} cannot be changed by {delta:+.3g} to find its derivative"
        raise InputError(f"{text}: {e}") from e


def feasible_stencil(make: Callable[[float], "Mechanism"], h: float) -> tuple[float, tuple[int, ...]]:
    """Return a difference width at which mechanisms exist, on both sides or on one side (some inertias are limited).

    Args:
        make: creates the mechanism with a parameter changed by the given amount.
        h: the largest width.

    Returns:
        The width, and the stencil, see `mbdae.finite_differences.central_difference`; the given width and the two-sided
        stencil if mechanisms exist on neither side.
    """
    for stencil, points in TRIAL_POINTS.items():
        for i in range(MAX_REDUCTIONS):
            with suppress(InputError):
                _ = [make(k * h / REDUCTION**i) for k in points]
                return h / REDUCTION**i, stencil
    return h, STENCIL
