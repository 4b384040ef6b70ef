"""Base classes of functions of time, and of piecewise polynomials of time."""

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property
from math import inf

from ...data_types import CoreData
from ...finite_differences import numerical_derivative
from ..checked_table import Table
from .piecewise_polynomial import PiecewisePolynomial

SPACING = 3e-3  # s: spacing of finite differences


class BaseTimeFunction(Table):
    """A function of time."""

    @abstractmethod
    def at(self, t: float, k: int = 0) -> float:
        """Return the k-th derivative with respect to time, k = 0, 1, 2, as given; see `derivative`."""

    def derivative(self, t: float, k: int = 1) -> float:
        """Return the k-th derivative, k = 1, 2, 3; if not given, a sixth-order difference of the (k-1)-th."""
        if k < 3 and self.has_derivative(k):
            return self.at(t, k)
        return float(numerical_derivative(lambda x: self.at(t + x, k - 1), SPACING))

    def has_derivative(self, k: int) -> bool:
        """Return whether the k-th derivative is given, k = 0, 1, 2."""
        return True

    @property
    def nonsmooth_times(self) -> Sequence[float]:
        """Times where the function is not smooth."""
        return ()

    @property
    def knots(self) -> Sequence[float]:
        """Times where two polynomials join, within one period."""
        return ()

    def knots_between(self, t0: float, t1: float) -> Sequence[float]:
        """Return the times between t0 and t1 where two polynomials join."""
        return ()

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the first nonsmooth time after t in the direction of sign; sign * inf if there is none."""
        return sign * min((sign * s for s in self.nonsmooth_times if sign * s > sign * t), default=inf)

    @abstractmethod
    def core_data(self) -> CoreData:
        """Return the core data."""


class PiecewiseFunction(BaseTimeFunction):
    """A piecewise polynomial of time."""

    @cached_property
    @abstractmethod
    def polynomials(self) -> PiecewisePolynomial:
        """The polynomials."""

    def at(self, t: float, k: int = 0) -> float:
        return self.polynomials.at(t, k)

    @property
    def nonsmooth_times(self) -> Sequence[float]:
        return self.polynomials.nonsmooth_times

    @property
    def knots(self) -> Sequence[float]:
        return self.polynomials.breakpoints[1:]

    def knots_between(self, t0: float, t1: float) -> Sequence[float]:
        return self.polynomials.knots_between(t0, t1)

    def derivative(self, t: float, k: int = 1) -> float:
        return self.polynomials.derivative(t, k)

    def core_data(self) -> CoreData:
        return self.polynomials.core_data()
