"""A network of capacitors driven by a voltage source, whose current is the multiplier."""

import numpy as np

from ...system import Array
from ..hessenberg import Hessenberg

__all__ = ["driven_circuit"]

C1, C2, C3 = 1.0, 0.5, 1.0  # nF: node 1 to ground, between the nodes, node 2 to ground
CONDUCTANCE, INDUCTANCE, RESISTANCE = 0.2, 2.0, 0.5  # node 2 to ground: mS; mH in series with kOhm
SATURATION_CURRENT, THERMAL_VOLTAGE = 1e-3, 0.25  # mA and V, of the diode at node 2
CAPACITANCE = np.array([[C1 + C2, -C2], [-C2, C2 + C3]])
ELASTANCE = np.linalg.inv(CAPACITANCE)


def source(t: float) -> tuple[float, float]:
    """Return the voltage of the source at a time in microseconds, and its rate."""
    return float(np.sin(2 * t)), float(2 * np.cos(2 * t))


def diode(u: float) -> tuple[float, float]:
    """Return the current of the diode, and its derivative."""
    current = SATURATION_CURRENT * np.exp(u / THERMAL_VOLTAGE)
    return current - SATURATION_CURRENT, current / THERMAL_VOLTAGE


def f(t: float, y: Array, z: Array) -> Array:
    """Return the rates of the voltages and of the inductor's current, (3,)."""
    _, e2, i = y
    current = np.array([z[0], -CONDUCTANCE * e2 - diode(e2)[0] - i])
    return np.append(ELASTANCE @ current, (e2 - RESISTANCE * i) / INDUCTANCE)


def f_y(t: float, y: Array, z: Array) -> Array:
    """Return the partial derivatives of f, (3, 3)."""
    out = np.zeros((3, 3))
    out[:2, 1:] = np.outer(ELASTANCE[:, 1], [-CONDUCTANCE - diode(y[1])[1], -1.0])
    out[2, 1:] = 1 / INDUCTANCE, -RESISTANCE / INDUCTANCE
    return out


def driven_circuit() -> Hessenberg:
    """Node voltages e = (e1, e2), the current i of an inductor, and the current z of a source of voltage V(t).

        C e' = (z, -G e2 - I(e2) - i),   L i' = e2 - R i,   0 = e1 - V(t),   I(e) = I_s (exp(e/U) - 1)

    Modified nodal analysis has index 2 because of the loop of the source and capacitors; a diode makes it nonlinear.
    Units: V, mA, microseconds, nF, mH, kOhm. Source: C. Tischendorf, Surv. Math. Ind. 8 (1999), for the index.
    """
    rate = source(0.0)[1]
    return Hessenberg(
        f=f,
        g=lambda t, y: np.array([y[0] - source(t)[0]]),
        g_y=lambda t, y: np.array([[1.0, 0.0, 0.0]]),
        f_z=lambda t, y, z: np.array([[ELASTANCE[0, 0]], [ELASTANCE[1, 0]], [0.0]]),
        g_t=lambda t, y: np.array([-source(t)[1]]),
        f_y=f_y,
        y0=(0.0, 0.0, 0.0),
        z0=(rate / ELASTANCE[0, 0],),
        name="driven_circuit",
        title="Circuit driven by a voltage source",
        duration=6.0,
    )
