"""Deviations of signals along a curve: worst cases, statistics, contributions, and bands around paths."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...errors import InputError, UnknownNameError
from ...system import Array
from ..kinematics.curve_derivatives import AXES
from ..kinematics.result import Kinematics
from .influences import Influences

PATH = "position."


class Contribution(NamedTuple):
    """Contribution of one parameter or clearance to the deviations of a signal, in the pose of the largest worst case.

    Attributes:
        name: name of the parameter, joint or closure.
        size: tolerance or clearance.
        influence: derivative of the signal; for a clearance |lam|.
        worst: contribution to the worst case, |influence| size.
        share: fraction of the worst case.
        variance_share: fraction of the first-order variance.
    """

    name: str
    size: float
    influence: float
    worst: float
    share: float
    variance_share: float


@dataclass(frozen=True)
class Deviations:
    """Deviations of m signals along a curve of n poses, at fixed inputs.

    Attributes:
        curve: the nominal poses.
        signals: names of the signals.
        units: units of the signals by name.
        tolerances: k tolerances by parameter.
        clearances: c clearances by joint or closure.
        sigmas: number of standard deviations in a tolerance.
        influences: derivatives, see `Influences`.
        hessians: second derivatives with respect to the parameters, (m, n, k, k); None without ``second_order``.
        left_out: names from patterns that are omitted, since they would violate redundant closures.
        parameter_units: units of parameters by name; "" if unknown.
    """

    curve: Kinematics
    signals: tuple[str, ...]
    units: dict[str, str]
    tolerances: dict[str, float]
    clearances: dict[str, float]
    sigmas: float
    influences: Influences
    hessians: Array | None = None
    left_out: tuple[str, ...] = ()
    parameter_units: dict[str, str] = field(default_factory=dict)

    @cached_property
    def sizes(self) -> Array:
        """Tolerances and then clearances, (k + c,)."""
        return np.array([*self.tolerances.values(), *self.clearances.values()])

    @cached_property
    def standard_deviations(self) -> Array:
        """Standard deviations of parameters, and of clearances along one of their directions, by pose, (n, k + c)."""
        by_axis = np.array(list(self.clearances.values())) / np.sqrt(np.maximum(self.influences.directions, 1))
        return np.hstack([np.tile(self._sigma, (len(by_axis), 1)), by_axis])

    @cached_property
    def magnitudes(self) -> Array:
        """Absolute influences of all parameters and clearances, (m, n, k + c)."""
        return _magnitudes(self.influences.derivatives, self.influences.clearances)

    @cached_property
    def worst(self) -> Array:
        """Worst case of each signal, sum |do/dp_i| t_i + sum c_k |lam_k|, (m, n)."""
        return self.magnitudes @ self.sizes

    @cached_property
    def deviation(self) -> Array:
        """Standard deviation of each signal to first order, (m, n)."""
        return np.linalg.norm(self.magnitudes * self.standard_deviations, axis=-1)

    @cached_property
    def statistical(self) -> Array:
        """Root of the sum of squares of all contributions to the worst case (RSS), (m, n)."""
        return np.linalg.norm(self.magnitudes * self.sizes, axis=-1)

    @cached_property
    def mean_shift(self) -> Array:
        """Mean minus nominal value, 1/2 sum H_ii sigma_i^2, (m, n).

        Raises:
            InputError: without ``second_order``.
        """
        return np.einsum("mnii,i->mn", self._second_order, self._sigma**2) / 2

    @cached_property
    def second_order_deviation(self) -> Array:
        """Second-order standard deviation, whose variance has the terms 1/2 sum (H_ij sigma_i sigma_j)^2, (m, n).

        Raises:
            InputError: without ``second_order``.
        """
        scaled = self._second_order * np.outer(self._sigma, self._sigma)
        return np.asarray(np.sqrt(self.deviation**2 + (scaled**2).sum(axis=(-2, -1)) / 2))

    @property
    def _second_order(self) -> Array:
        if self.hessians is None:
            raise InputError("the analysis is of first order: give second_order=True and tolerances of parameters")
        return self.hessians

    @property
    def _sigma(self) -> Array:
        return np.array(list(self.tolerances.values())) / self.sigmas

    @cached_property
    def nonlinearity(self) -> Array:
        """Relative error of the linear worst case, estimated from the distance to a dead point of the input, (n,).

        Above 0.25 the mechanism may not assemble at the input. Infinite at dead points and where closures lose rank.
        """
        x, curve = self.influences, self.curve
        by_clearances = np.linalg.norm(x.along_clearances, axis=-1)
        alpha = np.concatenate([np.abs(x.along), by_clearances], axis=-1) @ self.sizes
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(curve.input_curvature * alpha / curve.speed) / 2
        return np.where(np.isfinite(ratio), ratio, np.inf)

    def worst_pose(self, signal: str) -> int:
        """Return the index of the pose with the largest worst case of a signal.

        Raises:
            InputError: if it is undefined in all poses.
        """
        row = self.worst[self._index(signal)]
        if np.isnan(row).all():
            raise InputError(f"the influences on {signal!r} are undefined in all poses")
        return int(np.nanargmax(row))

    def contributions(self, signal: str) -> list[Contribution]:
        """Return the contributions to a signal in its worst pose, largest first.

        Raises:
            UnknownNameError: for a signal that was not analysed.
        """
        m, i = self._index(signal), self.worst_pose(signal)
        influence, k = self.magnitudes[m, i].copy(), len(self.tolerances)
        influence[:k] = self.influences.derivatives[m, i]
        worst, variances = (
            self.magnitudes[m, i] * self.sizes,
            (self.magnitudes[m, i] * self.standard_deviations[i]) ** 2,
        )
        shares = worst / (worst.sum() or 1.0), variances / (variances.sum() or 1.0)
        names = [*self.tolerances, *self.clearances]
        rows = zip(names, *(x.tolist() for x in (self.sizes, influence, worst, *shares)), strict=True)
        return sorted((Contribution(*row) for row in rows), key=lambda x: -x.worst)

    def band(self, frame: str) -> tuple[Array, Array, Array]:
        """Return worst case and statistical half-widths of the band around a path, and its normals.

        The path is that of a frame in the plane of its two position signals; the half-width is the deviation along the
        normal of the path.

        Returns:
            Half-widths in m, (n,) each, and unit normals (n, 2).

        Raises:
            InputError: if the signals do not have two positions of the frame.
        """
        rows = [i for i, name in enumerate(self.signals) if name.rpartition(".")[0] == f"{PATH}{frame}"]
        if len(rows) != 2:
            raise InputError(f"a band needs two signals {PATH}{frame}.x, .y or .z, there are {len(rows)}")
        rates = self.curve.frames([frame])[1][0][:, [AXES.index(self.signals[i][-1]) for i in rows]]
        with np.errstate(divide="ignore", invalid="ignore"):
            normals = rates[:, ::-1] * [-1.0, 1.0] / np.linalg.norm(rates, axis=1, keepdims=True)
        x = self.influences
        by_parameters = np.einsum("mnk,nm->nk", x.derivatives[rows], normals)
        by_displacements = np.einsum("mncw,nm->ncw", x.clearances[rows], normals)
        magnitudes = _magnitudes(by_parameters, by_displacements)
        return magnitudes @ self.sizes, np.linalg.norm(magnitudes * self.sizes, axis=-1), normals

    def paths(self) -> list[str]:
        """Return the frames with two position signals, whose paths have bands."""
        found = [name.rpartition(".")[0].removeprefix(PATH) for name in self.signals if name.startswith(PATH)]
        return [frame for frame in dict.fromkeys(found) if found.count(frame) == 2]

    def _index(self, signal: str) -> int:
        if signal not in self.signals:
            raise UnknownNameError("signal", signal, self.signals)
        return self.signals.index(signal)


def _magnitudes(derivatives: Array, clearances: Array) -> Array:
    """Return absolute influences (..., n, k + c) of parameters (..., n, k) and of displacements (..., n, c, w)."""
    return np.concatenate([np.abs(derivatives), np.linalg.norm(clearances, axis=-1)], axis=-1)
