"""The period of functions of time in a mechanism."""

from collections.abc import Sequence
from math import e
from typing import Any

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.closures.driver import Driver
from ...mechanism.equations.invariance import TWO_PI, MotionPoint, is_invariant, shift_units
from ...mechanism.forces.sampled import SampledElement
from ...mechanism.formulations.equation_partials import time_partials
from ...mechanism.time_functions.time_functions import Harmonic, Polynomial, TimeTable
from ...system import Array
from ...tolerances import INPUT_DIGITS

SAMPLED_TIMES = 3  # number of times at which time dependence is checked
MAX_MULTIPLE = 64  # largest common period, as a multiple of the longest of several periods


def is_autonomous(mech: Mechanism, t: float, y: Array) -> bool:
    """Return whether forces and drivers do not depend on time, checked at several times.

    A prescribed constant speed without a position is autonomous; a sampled controller is not.
    """
    system = mech.system()
    if _sampling_rates(mech):
        return False
    (q, v), inner, positional = system.split(y), system.element_states(y), system.constraints.positional
    for k in range(SAMPLED_TIMES):
        at = t + k * mech.duration / e
        by_time = system.g_t(at)[positional], *time_partials(system, at, q, v, inner, np.zeros(mech.ng))
        if any(x.any() for x in by_time):
            return False
    return True


def has_period(mech: Mechanism, T: float, points: Sequence[MotionPoint], shifts: Array) -> bool:
    """Return whether equations have the period T at some points, with joints shifted by ``shifts`` (nv,)."""
    samples = (T * w / TWO_PI for w in _sampling_rates(mech))
    return all(abs(x - round(x)) <= INPUT_DIGITS * x for x in samples) and all(
        is_invariant(mech, p, -shifts, -T) for p in points
    )


def period_of_functions(mech: Mechanism) -> float:
    """Return the common period in s of the functions of time in drivers and forces.

    These are harmonic functions, periodic tables, sampled controllers, and constant speeds of joints with full turns.

    Raises:
        InputError: for other functions of time, or frequencies without a small common multiple.
    """
    found = *_frequencies([*mech.drivers, *mech.forces]), *_sampling_rates(mech), *_joint_speeds(mech)
    omegas = sorted({abs(x) for x in found} - {0.0})
    if not omegas:
        raise InputError(
            "forces or drivers depend on time, but not as harmonic functions, periodic tables or constant speeds of"
            " joints that turn: give their period, T"
        )
    for n in range(1, MAX_MULTIPLE + 1):
        T = n * TWO_PI / omegas[0]
        cycles = np.array(omegas) * T / TWO_PI
        if np.abs(cycles - np.round(cycles)).max() <= INPUT_DIGITS:
            return T
    raise InputError("the frequencies of forces and drivers have no common period: give T")


def _frequencies(values: Any) -> list[float]:
    """Return the frequencies in rad/s of functions in tables of drivers and forces."""
    if isinstance(values, Harmonic):
        return [values.omega]
    if isinstance(values, TimeTable):
        return [TWO_PI / (values.points[-1][0] - values.points[0][0])] if values.beyond == "periodic" else []
    if hasattr(type(values), "model_fields"):
        values = [getattr(values, name) for name in type(values).model_fields]
    return [x for value in values for x in _frequencies(value)] if isinstance(values, list | tuple) else []


def _sampling_rates(mech: Mechanism) -> list[float]:
    """Return the sampling rates in rad/s of controllers."""
    return [TWO_PI * law.rate for law, _ in mech.system().laws.bound if isinstance(law, SampledElement)]


def _joint_speeds(mech: Mechanism) -> list[float]:
    """Return the prescribed constant speeds in rad/s of joints with full turns."""
    turns, out = shift_units(mech) == TWO_PI, list[float]()
    for driver in mech.drivers:
        if isinstance(driver, Driver) and driver.joint and isinstance(driver.motion, Polynomial):
            joint, c = mech.model.joints[mech.model.getJointId(driver.joint)], driver.motion.coefficients
            if joint.nq == 2 or turns[joint.idx_v]:
                out += [c[1]] if len(c) == 2 else []
    return out
