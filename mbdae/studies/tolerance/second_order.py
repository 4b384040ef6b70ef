"""Second derivatives of signals with respect to parameters, by differences of exact first derivatives."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...mechanism.assembly.position_search import gauss_newton, is_closed
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...system import Array
from ...tolerances import RANK
from ..kinematics.curve_derivatives import CurveSignals
from ..kinematics.result import Kinematics

SAME_BRANCH = 0.2  # rad or characteristic lengths, largest displacement by tolerances on the same branch
Bind = Callable[[Mapping[str, float]], Parameters]


def hessians(
    found: Kinematics, names: Sequence[str], bind: Bind, values: Mapping[str, float], widths: Mapping[str, float]
) -> Array:
    """Return d2(signal)/dp2 in each pose at fixed inputs, (m, n, k, k), symmetric; nan where a pose cannot be closed.

    They are central differences at p +- h, h being one standard deviation, where loops are closed again. Their error
    is of the order of the terms that second-order moments neglect.

    Args:
        found: the curve.
        names: names of m signals.
        bind: returns parameters with these values, bound to a mechanism whose last driver is the input.
        values: values of k parameters.
        widths: widths h by parameter.
    """
    columns = []
    for name, value in values.items():
        high, low = (
            _derivatives(found, names, bind({**values, name: value + h})) for h in (widths[name], -widths[name])
        )
        columns.append((high - low) / (2 * widths[name]))
    H = np.stack(columns, axis=-1)
    return np.asarray((H + H.swapaxes(-1, -2)) / 2)


def _derivatives(found: Kinematics, names: Sequence[str], parameters: Parameters) -> Array:
    """Return the derivatives of signals at the inputs of a curve with other parameters, (m, n, k)."""
    changed, closed = curve_with(found, parameters)
    signals = CurveSignals(changed, lambda: parameters)
    out = np.array([signals.derivative(name) for name in names])
    out[:, ~closed] = np.nan
    return out


def curve_with(found: Kinematics, parameters: Parameters) -> tuple[Kinematics, Array]:
    """Return the poses of a curve with other parameters at the same inputs, and a mask of those that close, (n,)."""
    system, mech = parameters.system, parameters.mech
    q, rates, closed = found.q.copy(), np.zeros_like(found.tangent), found.moving.copy()
    for i in np.flatnonzero(closed):
        q[i] = gauss_newton(system, found.q[i], np.arange(system.nv), float(found.u[i]))
        change = np.abs(system.manifold.difference(found.q[i], q[i]) / mech.coordinate_scales).max()
        closed[i] = is_closed(system, q[i], float(found.u[i])) and change < SAME_BRANCH
        rates[i] = np.linalg.pinv(system.jacobian(q[i]), rcond=RANK)[:, -1]
    return replace(found, mechanism=mech, q=q, tangent=rates, speed=np.ones(len(q))), closed
