"""A stirred tank reactor whose coolant valve makes the temperature follow a prescribed path."""

import numpy as np

from ...system import Array
from ..hessenberg import Hessenberg

__all__ = ["controlled_reactor"]

FEED, FEED_TEMPERATURE, COOLANT = 1.0, 1.3, 0.8  # concentration and temperatures, scaled
RATE, ACTIVATION, HEAT, TRANSFER = 0.5, 5.0, 0.6, 6.0


def required_temperature(t: float) -> tuple[float, float]:
    """Return the required temperature, and its rate of change."""
    return 1.2 - 0.2 * float(np.cos(t)), 0.2 * float(np.sin(t))


def rate_constant(T: float) -> tuple[float, float]:
    """Return k(T) = k_0 exp(E (1 - 1/T)), and its derivative."""
    k = RATE * float(np.exp(ACTIVATION * (1 - 1 / T)))
    return k, k * ACTIVATION / T**2


def f(t: float, y: Array, z: Array) -> Array:
    """Return the rates of concentration and temperature, (2,)."""
    c, T = y
    k, _ = rate_constant(T)
    cooling = TRANSFER * np.exp(z[0]) * (T - COOLANT)
    return np.array([FEED - c - k * c, FEED_TEMPERATURE - T + HEAT * k * c - cooling])


def f_y(t: float, y: Array, z: Array) -> Array:
    """Return the partial derivatives of f with respect to y, (2, 2)."""
    c, T = y
    k, dk = rate_constant(T)
    return np.array([[-1 - k, -dk * c], [HEAT * k, -1 + HEAT * dk * c - TRANSFER * np.exp(z[0])]])


def controlled_reactor() -> Hessenberg:
    """Concentration c and temperature T of a stirred tank, and the position z of the coolant valve.

        c' = 1 - c - k(T) c,   T' = T_f - T + H k(T) c - B e^z (T - T_c),   0 = T - T_r(t)

    The temperature follows a path; all quantities are scaled. The valve has an equal-percentage characteristic, so that
    f is nonlinear in z. Path control has index 2 if the control input acts on the rate of the controlled variable.
    Source: Brenan, Campbell, Petzold, Numerical Solution of Initial-Value Problems in Differential-Algebraic Equations
    (1996), chapter 1, for path control.
    """
    return Hessenberg(
        f=f,
        g=lambda t, y: np.array([y[1] - required_temperature(t)[0]]),
        g_y=lambda t, y: np.array([[0.0, 1.0]]),
        f_z=lambda t, y, z: np.array([[0.0], [-TRANSFER * np.exp(z[0]) * (y[1] - COOLANT)]]),
        g_t=lambda t, y: np.array([-required_temperature(t)[1]]),
        f_y=f_y,
        y0=(0.6, required_temperature(0.0)[0]),
        z0=(-1.4,),
        name="controlled_reactor",
        title="Stirred tank reactor with a prescribed temperature",
        duration=6.0,
    )
