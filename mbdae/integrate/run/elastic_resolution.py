"""Vibrations of flexible bodies in a run: those that limit its steps, and those that its steps do not resolve.

A vibration eta'' + 2 zeta w eta' + w^2 eta = F(t) follows the quasi-static deflection eta_s = F/w^2, and oscillates
about it, to first order in 1/w, with the velocity amplitude r, r^2 = (eta' - eta_s')^2 + (w (eta - eta_s) +
2 zeta eta_s')^2. A step h multiplies its oscillation by R(z), z = h w (-zeta + i sqrt(1 - zeta^2)), in place of exp(z).
The relative error |R(z) exp(-z) - 1|, in phase and amplitude, accumulates while the oscillation lasts. R is the
stability function of a Runge-Kutta method; for others of order p (generalized-alpha, compositions, library solvers) the
error is estimated by |z|^(p + 1)/12, that of the trapezoidal rule for p = 2.
"""

from typing import Any, NamedTuple

import numpy as np

from ...errors import StepError
from ...mechanism.equilibrium.elastic_modes import ElasticModes, elastic_modes
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.tree.tree_terms import flexible_bodies
from ...methods import RungeKutta, method_from_settings
from ...methods.explicit import ExplicitMethod
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import COARSE, EVALUATION_ROUNDING, NEGLIGIBLE, TINY, VISIBLE
from ..steppers.solvers import find_method

SAMPLES = 9  # number of nodes at which the vibrations are computed, including the first one
SIZES = 48  # number of step sizes at which R is evaluated, with interpolation in between
QUOTIENT_WIDTH = 1e-3  # fraction of 1/w: width of the forward difference of the quasi-static deflection
RATE_ROUNDING = EVALUATION_ROUNDING / QUOTIENT_WIDTH  # rounding of such a difference, relative to sqrt(2 T)
MAX_ERROR = 0.05  # fraction of the largest velocity amplitude: a vibration with a larger error is not resolved
DIVERGENCE_FACTOR = 10.0  # amplification of a vibration over a run that counts as divergence
MIN_LIMITING = 0.2  # h w: vibrations with smaller values do not limit the step
MAX_DAMPING = 0.3  # damping ratio: vibrations with larger ratios decay within a cycle


class Vibrations(NamedTuple):
    """Vibrations at some nodes of a run.

    Attributes:
        modes: elastic modes at the first node.
        names: labels with the frequencies at the first node, (m,).
        nodes: indices of the nodes, (n,).
        amplitudes: velocity amplitudes of the oscillation, (n, m), in m sqrt(kg)/s.
        largest: largest velocity amplitude or modal velocity over the nodes, (m,).
        tolerance: tolerance of velocity amplitudes.
        errors: errors of velocity amplitudes that step-size control allows, (m,), so that the method may excite them.
    """

    modes: ElasticModes
    names: Array
    nodes: Array
    amplitudes: Array
    largest: Array
    tolerance: float
    errors: Array


def unresolved_vibrations(sol: Solution, vibrations: Vibrations) -> str:
    """Return which vibrations of flexible bodies a run does not resolve; empty if there are none."""
    s, ts, method = sol.settings, sol.nodes[0], _method(sol)
    sizes = np.abs(np.diff(ts))
    errors = np.array([_error(vibrations, k, ts, sizes, method) for k in range(len(vibrations.names))])
    names = ", ".join(vibrations.names[(errors > vibrations.tolerance) & (errors > MAX_ERROR * vibrations.largest)])
    smaller = f"take a smaller {'step' if 'step' in s else 'rtol'}, damp it or drop it"
    return f"not resolved: {names}, whose vibration {s['method']} damps or delays: {smaller}" if names else ""


def _method(sol: Solution) -> Any:
    s = sol.settings
    return method_from_settings(s) if "tableau" in s else find_method(s["formulation"], s["method"])


def amplified_vibrations(sol: Solution) -> str:
    """Return which vibrations of flexible bodies the fixed steps of a run amplify; empty if there are none."""
    (ts, ys, _), h, method = sol.nodes, sol.settings.get("step"), _method(sol)
    if not (h and isinstance(method, RungeKutta | ExplicitMethod) and flexible_bodies(sol.mechanism.model)):
        return ""
    try:
        modes = elastic_modes(sol.system, ts[0], ys[0, : sol.system.nq])
    except StepError:
        return ""
    factors = np.abs(stability_function(method, h * _exponents(modes)))
    names = ", ".join(_names(modes)[factors ** len(ts) > DIVERGENCE_FACTOR])
    remedy = "take a smaller step, damp it or drop it"
    return f"the run diverges: steps of {h:g} s amplify {names}: {remedy}" if names else ""


def limiting_vibration(sol: Solution, vibrations: Vibrations) -> str:
    """Return which vibration of a flexible body limits the steps of a run; empty if none does."""
    if "step" in sol.settings:
        return ""
    w, ratios, h = vibrations.modes.frequencies, vibrations.modes.ratios, np.abs(np.diff(sol.nodes[0]))
    excited = vibrations.amplitudes.max(axis=0) > vibrations.tolerance
    limits = excited & (h.mean() * w > MIN_LIMITING) & (ratios < MAX_DAMPING)
    return f"steps limited by {vibrations.names[limits][-1]}; damp or drop it" if limits.any() else ""


def find_vibrations(sol: Solution) -> Vibrations | None:
    """Return the vibrations of flexible bodies; None if there are none, or if the equations cannot be evaluated."""
    ts, ys, _ = sol.nodes
    if len(ts) < 2 or not flexible_bodies(sol.mechanism.model):
        return None
    system, nodes = sol.system, np.unique(np.linspace(0, len(ts) - 1, SAMPLES).astype(int))
    try:
        modes = elastic_modes(system, ts[0], ys[0, : system.nq])
        if not len(w := modes.frequencies):
            return None
        rates = np.array([_oscillation(system, modes, ts[i], ys[i]) for i in nodes])
        kinetic = max(system.energy(*system.split(ys[i]))[0] for i in nodes)
    except StepError:
        return None
    velocity_indices = system.nq + modes.iv
    deflections, speeds = (np.abs(ys[:, i] @ modes.rows.T).max(axis=0) for i in (modes.iq, velocity_indices))
    largest = np.maximum(rates.max(axis=0), speeds)  # at rest the deflections have the tolerance
    relative = VISIBLE if "step" in sol.settings else min(sol.settings["rtol"], COARSE)
    rounding = RATE_ROUNDING * np.sqrt(2 * kinetic)
    tolerance = max(relative * np.maximum(largest, w * deflections).max(), rounding)
    atol = np.asarray(sol.settings.get("atol", 0.0))
    errors = (1 + w) * (atol[modes.iv] if atol.ndim else atol).max()  # tolerances of eta' and of w eta
    return Vibrations(modes, _names(modes), nodes, rates, largest, tolerance, errors)


def _names(modes: ElasticModes) -> Array:
    """Return labels with frequencies, (m,)."""
    pairs = zip(modes.labels, modes.frequencies, strict=True)
    return np.array([f"{label} ({float(f'{x:.3g}'):g} rad/s)" for label, x in pairs])


def _exponents(modes: ElasticModes) -> Array:
    """Return the exponents of the vibrations in 1/s, (m,): -zeta w + i w sqrt(1 - zeta^2)."""
    ratios = np.minimum(modes.ratios, 1.0)
    return modes.frequencies * (-ratios + 1j * np.sqrt(1 - ratios**2))


def _oscillation(system: Index2System, modes: ElasticModes, t: float, y: Array) -> Array:
    """Return the velocity amplitude of each vibration about the quasi-static deflection, (m,)."""
    nq, nv, w, lag = system.nq, system.nv, modes.frequencies, 2 * modes.ratios / modes.frequencies

    def quasi_static(t: float, y: Array) -> tuple[Array, Array]:
        F = system.derivative(t, y)[0]
        eta, rate, acceleration = (modes.rows @ x for x in (y[modes.iq], y[nq + modes.iv], F[nv + modes.iv]))
        return eta + lag * rate + acceleration / w**2, F

    dt = QUOTIENT_WIDTH / w[-1]
    deflection, F = quasi_static(t, y)
    speed = (quasi_static(t + dt, system.add(y, dt * F))[0] - deflection) / dt
    eta, rate = modes.rows @ y[modes.iq], modes.rows @ y[nq + modes.iv]
    return np.hypot(rate - speed, w * (eta - deflection + lag * speed))


def _error(vibrations: Vibrations, k: int, ts: Array, h: Array, method: Any) -> float:
    """Return the largest error of the velocity amplitude of vibration k, accumulated over steps while it oscillates.

    After the start, only vibrations larger than the errors of the run are considered.
    """
    z = _exponents(vibrations.modes)[k]
    sizes = np.geomspace(max(h.min(), TINY), h.max() * (1 + NEGLIGIBLE), SIZES)
    errors = np.interp(h, sizes, step_error(method, z * sizes))
    total, worst = np.concatenate([[0.0], np.cumsum(errors)]), 0.0
    rates = vibrations.amplitudes[:, k]
    rates = np.where((vibrations.nodes == 0) | (rates > vibrations.errors[k]), rates, 0.0)
    for i, rate in zip(vibrations.nodes[:-1], rates[:-1], strict=True):
        decay = np.exp(z.real * np.abs(ts[i + 1 :] - ts[i]))
        worst = max(worst, float((rate * decay * np.minimum(total[i + 1 :] - total[i], 1.0)).max()))
    return worst


def step_error(method: Any, z: Array) -> Array:
    """Return |R(z) exp(-z) - 1| of steps of a method, (n,); an estimate if it is not a Runge-Kutta method."""
    if not isinstance(method, RungeKutta | ExplicitMethod):
        return np.abs(z) ** (method.order + 1) / 12
    return np.abs(stability_function(method, z) - np.exp(z)) / np.maximum(np.abs(np.exp(z)), TINY)


def stability_function(method: RungeKutta | ExplicitMethod, z: Array) -> Array:
    """Return R(z) of a method, (n,)."""
    A, b = method.arrays.A, method.arrays.b
    stages = np.linalg.solve(np.eye(len(b)) - np.multiply.outer(z, A), np.ones((len(b), 1)))[..., 0]
    return 1 + z * (stages @ b)
