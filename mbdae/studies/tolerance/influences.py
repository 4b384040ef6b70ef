"""Influences of parameters and clearances on signals in each pose, and how far the linear analysis is valid.

The rows are scaled by characteristic lengths and angles. Close to a dead point of the input joint the smallest singular
value of G is about |du/ds|, the change of the input u per arclength s of the curve of poses. A tolerance that changes
the pose by alpha_0 along the curve to first order changes it by the solution a of

    u' alpha_0 = u' a + u''/2 a^2,    a = alpha_0 (1 - u'' alpha_0/(2 u') + ...)

For one sign of alpha_0 it does not exist if 2 |u'' alpha_0/u'| > 1: the mechanism may not assemble at this input.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...system import Array
from ...tolerances import RANK, SOLUTION_ROUNDING
from ..kinematics.curve_derivatives import CurveSignals
from .clearances import Displacements, largest_axis_count


@dataclass(frozen=True)
class Influences:
    """First-order influences on m signals in n poses; nan at dead points of the input joint and at rank losses of G.

    Attributes:
        values: the signals, (m, n).
        derivatives: derivatives with respect to k parameters, (m, n, k).
        clearances: derivatives with respect to displacements in c joints along w axes, (m, n, c, w), without directions
            that closures exclude, and 0 beyond the axes of a joint.
        directions: number of directions in which a clearance can act, (n, c).
        along: derivatives of the arclength along the curve with respect to parameters, (n, k), in rad and
            characteristic lengths.
        along_clearances: derivatives of the arclength with respect to displacements, (n, c, w).
        condition: condition number of the scaled rows, (n,).
    """

    values: Array
    derivatives: Array
    clearances: Array
    directions: Array
    along: Array
    along_clearances: Array
    condition: Array


def influences(signals: CurveSignals, names: Sequence[str], clearances: Mapping[str, Displacements]) -> Influences:
    """Return the influences on signals along a curve.

    Args:
        signals: signals of the curve, with the parameters.
        names: names of the signals.
        clearances: displacements by joint or closure.
    """
    n, shifts = len(signals.curve.u), list(clearances.values())
    found, poses, w = signals.curve, signals.poses, largest_axis_count(shifts)
    values = np.array([signals[name] for name in names])
    derivatives = np.array([signals.derivative(name) for name in names])
    columns = found.mechanism.coordinate_scales
    dq = -(poses.inverse @ poses.rows) / columns[:, None]
    along = np.einsum("ni,nik->nk", found.tangent / columns, dq)
    by_clearances = np.zeros((len(names), n, len(shifts), w))
    along_clearances, directions = np.zeros((n, len(shifts), w)), np.zeros((n, len(shifts)), int)
    condition, scales, nulls = _condition_numbers(signals)
    for c, shift in enumerate(shifts):
        by_axis = np.array([shift.derivative(name) for name in names])
        change = -(poses.inverse @ shift.rows) / columns[:, None]
        for i in range(n):
            Z = shift.free(i, nulls[i], scales)
            width, directions[i, c] = Z.shape
            by_clearances[:, i, c, :width] = by_axis[:, i] @ Z @ Z.T
            along_clearances[i, c, :width] = (found.tangent[i] / columns) @ change[i] @ Z @ Z.T
    singular = ~found.moving | ~(condition < 1 / RANK)
    for x in (derivatives, by_clearances):
        x[:, singular] = np.nan
        x[np.abs(x) < SOLUTION_ROUNDING] = 0.0
    for x in (along, along_clearances, condition):
        x[singular] = np.nan
    return Influences(values, derivatives, by_clearances, directions, along, along_clearances, condition)


def _condition_numbers(signals: CurveSignals) -> tuple[Array, Array, list[Array]]:
    """Return condition numbers by pose, (n,), the scales of the rows, (ng,), and left null spaces, (ng, d) each."""
    system, found = signals.parameters.system, signals.curve
    scales = system.mechanism.row_scales
    condition, nulls = np.full(len(found.u), np.inf), []
    for i, q in enumerate(found.q):
        G = system.jacobian(q) * found.mechanism.coordinate_scales / scales[:, None]
        left, singular_values, _ = np.linalg.svd(G)
        if singular_values[-1] > RANK * singular_values[0] and len(singular_values) == system.nv:
            condition[i] = singular_values[0] / singular_values[-1]
        nulls.append(left[:, np.count_nonzero(singular_values > RANK * singular_values[0]) :])
    return condition, scales, nulls
