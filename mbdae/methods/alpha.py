"""Generalized-alpha methods for mechanisms on Lie groups, and HHT: order 2, with numerical damping.

    u_1 = u_0 + h ((1 - gamma) a_0 + gamma a_1),   q_1 = q_0 (+) (h v_0 + h^2 ((1/2 - beta) a_0 + beta a_1) + ...)
    (1 - alpha_m) a_1 + alpha_m a_0 = (1 - alpha_f) u_1' + alpha_f u_0'

for u = (v, s, w); `mbdae.mechanism.formulations.steps.newmark_step` has the equations of u_1'. The auxiliary a
approximates u' at t + Delta h, Delta = alpha_m - alpha_f; it is initialized so, and rescaled when h changes.

The error estimates of a step are its differences from the explicit step with a_1 = a_0, of order 1,

    e_q = beta h^2 (a_1 - a_0),   e_u = gamma h (a_1 - a_0).

They have the order of the method, like embedded error estimates of other methods, so the error of a run is
proportional to rtol. With the leading term of the local error, (beta - 1/6) h^2 (a_1 - a_0) for Newmark's method
(Zienkiewicz, Xie, Earthquake Engng. Struct. Dyn. 20 (1991)), it is proportional to rtol^(2/3), and velocities have no
estimate. In index 3 the step size is fixed: v_0 violates G v = 0 by an error d, so a_1 - a_0 contains d / h, and e_u
does not decrease with h.

Sources: Chung, Hulbert, J. Appl. Mech. 60 (1993); Arnold, Bruels, BIT 47 (2007); Hilber, Hughes, Taylor, Earthquake
Engng. Struct. Dyn. 5 (1977) and Negrut et al., J. Comput. Nonlinear Dyn. 2 (2007) for HHT.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from ..errors import InputError
from ..system import Array, State, Step, System
from .variational import TYPICAL_EVALUATIONS, NewtonMethod, make_step, solve_newton


@dataclass(frozen=True)
class GeneralizedAlpha(NewtonMethod):
    """A generalized-alpha method.

    Args:
        name: name typed by the user.
        title: one line for a list of methods.
        alpha_m: weight of a_0.
        alpha_f: weight of u_0'.
        stabilized: stabilized index-2 form; index 3 otherwise.
    """

    name: str
    title: str
    alpha_m: Fraction
    alpha_f: Fraction
    stabilized: bool = True

    family = "generalized alpha"
    reference = "Arnold, Bruels, BIT 47 (2007)"
    order = order_linear = order_own = 2
    roundings = 1  # per step: the velocity constraint determines v_1
    carries = True
    solves = TYPICAL_EVALUATIONS
    smallest_pivot = 0.1
    excludes: ClassVar[Mapping[str, str]] = {
        "textbook": "it integrates the second-order equations of a mechanism",
        "ggl": "it enforces positions and velocities in formulation 'index2'",
        "events": "it does not restart where the state jumps",
        "switches": "it does not restart in modes of stops, stiction, clutches and contacts",
        "velocity rows": "it enforces positions, which rolling and other constraints of velocities alone do not have",
    }

    @property
    def gamma(self) -> Fraction:
        """Weight of a_1 in velocities, for order 2."""
        return Fraction(1, 2) + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> Fraction:
        """Weight of a_1 in positions, for the largest damping of high frequencies."""
        return (self.gamma + Fraction(1, 2)) ** 2 / 4

    @property
    def error_power(self) -> int:
        """Power of h in the error estimate; 0 in index 3, where the step size is fixed, see the module."""
        return 2 if self.stabilized else 0

    @property
    def order_embedded(self) -> int:
        """Order of the explicit step."""
        return self.error_power // 2

    @property
    def position_pivot(self) -> float:
        """Partial derivative p = (d q_1/d v_1')/h^2; in index 3 the rounding error of z is eps / (p h^2).

        Infinite in index 2.
        """
        return np.inf if self.stabilized else float(self.beta * (1 - self.alpha_f) / (1 - self.alpha_m))

    def compiled(self, native: Any) -> Any:
        """Return the method for the compiled core."""
        return native.GeneralizedAlpha(
            alpha_m=float(self.alpha_m),
            alpha_f=float(self.alpha_f),
            beta=float(self.beta),
            gamma=float(self.gamma),
            stabilized=self.stabilized,
            iteration=self.iteration(native),
        )

    def step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take one step of a given size; its errors are empty, (0, ny).

        The carry is (a, u', h), (2 n + 1,): a and u' at the start of the next step, and the size h of this step.

        Raises:
            StepError: if Newton's method does not converge.
        """
        out = system.compiled_step(self, t, h, state)
        if out is not None:
            return out
        am, af, gamma, beta = map(float, (self.alpha_m, self.alpha_f, self.gamma, self.beta))
        step = system.newmark_step(t, h, state.y, self.stabilized)
        rate, a = rescaled(self.carry_at(system, t, h, state), h)
        weight, constant = (1 - af) / (1 - am), (af * rate - am * a) / (1 - am)
        u = h * ((1 - gamma) * a + gamma * constant)
        step.predict(h * h * ((0.5 - beta) * a + beta * constant), u, (h * gamma * weight, h * h * beta * weight), rate)
        du, z = solve_newton(system, step)
        dy, lam = step.end(du, z)
        return make_step(system, state, dy, lam, np.concatenate([constant + weight * du, du, [h]]))

    def controlled_step(self, system: Any, t: float, h: float, state: State) -> Step:
        """Take one step and estimate its errors, (1, ny), see the module; the carry is that of `step`.

        Raises:
            StepError: if Newton's method does not converge.
            InputError: in index 3.
        """
        if not self.stabilized:
            raise InputError(f"method {self.name!r} takes fixed steps: give a step in place of rtol")
        carry, n = self.carry_at(system, t, h, state), system.ny - system.nv
        out = self.step(system, t, h, state._replace(carry=carry))
        change = out.state.carry[:n] - rescaled(carry, h)[1]
        e_q, e_u = float(self.beta) * h * h * change[: system.nv], float(self.gamma) * h * change
        return out._replace(errors=np.concatenate([e_q, e_u])[None])

    def carry_at(self, system: Any, t: float, h: float, state: State) -> Array:
        """Return the carry of a state, (2 n + 1,), see `step`; that of `initial_carry` if the state has none."""
        n, carry = system.ny - system.nv, state.carry
        return self.initial_carry(system, t, h, state.y, n) if carry is None or len(carry) != 2 * n + 1 else carry

    def initial_carry(self, system: System, t: float, h: float, y: Array, n: int) -> Array:
        """Return the initial carry (2 n + 1,): a = u' + (alpha_m - alpha_f) h u'', u'' by a finite difference."""
        offset, F = float(self.alpha_m - self.alpha_f), system.derivative(t, y)[0]
        if not offset:
            return np.concatenate([F[-n:], F[-n:], [h]])
        dt = abs(offset) * h
        change = system.derivative(t + dt, system.add(y, dt * F))[0] - F
        return np.concatenate([(F + np.sign(offset) * change)[-n:], F[-n:], [h]])


def rescaled(carry: Array, h: float) -> tuple[Array, Array]:
    """Return u_0' and a_0, (n,) each, from a carry, with a_0 rescaled to a step of size h."""
    a, rate, last = np.split(carry, [len(carry) // 2, len(carry) - 1])
    return rate, rate + h / last * (a - rate)


def alpha_method(name: str) -> GeneralizedAlpha | None:
    """Return a method by name: ``"alpha0.6"``, ``"hht0.1_i3"``; None for a name of another pattern.

    Raises:
        InputError: for rho_inf outside of [0, 1], or alpha of HHT outside of [0, 1/3].
    """
    match = re.fullmatch(r"(alpha|hht)(\d+\.?\d*)?(_i3)?", name)
    if not match:
        return None
    kind, number, index3 = match[1], Fraction(match[2] or ("0.8" if match[1] == "alpha" else "0.1")), bool(match[3])
    form = "index 3" if index3 else "stabilized index 2"
    if kind == "hht":
        if number > Fraction(1, 3):
            raise InputError(f"{name!r}: alpha of HHT lies between 0 and 1/3")
        return GeneralizedAlpha(name, f"HHT, alpha = {float(number):g}, {form}", Fraction(0), number, not index3)
    if number > 1:
        raise InputError(f"{name!r}: rho_inf lies between 0 and 1")
    am, af = (2 * number - 1) / (number + 1), number / (number + 1)
    return GeneralizedAlpha(name, f"generalized alpha, rho_inf = {float(number):g}, {form}", am, af, not index3)


alpha, alpha_i3, hht, hht_i3 = (alpha_method(name) for name in ("alpha", "alpha_i3", "hht", "hht_i3"))
