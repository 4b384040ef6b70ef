"""Planar problems with index 1, in real numbers: for programs that compile or differentiate the equations.

    M a = f + G^T lam,   G a = -gamma - 2 alpha G v - alpha^2 g        (Baumgarte 1972)

The equations are those of planar.py. They are written once, with products that numpy's arrays, casadi's and JAX's
all have, and go to casadi (CVODES, IDAS, compiled to C where there is a compiler) and diffrax (JAX, compiled).
"""

import shutil
import tempfile
from collections.abc import Callable
from contextlib import chdir
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np
from planar import Equations, Problem
from runs import SAMPLES, Run, Runner, installed

STEPS = 1_000_000  # upper limit of a run


def terms(eq: Equations, constant: Callable[[Any], Any], c: Any, s: Any, v: Any, alpha: float) -> tuple[Any, ...]:
    """Return M (n, n), f (n, 1), the rows of G as real and imaginary parts (nc, n), and G a, (nc, 1) each.

    Args:
        eq: the problem's data.
        constant: converts a numpy array into one of the program.
        c: cos q, (n, 1).
        s: sin q, (n, 1).
        v: rates, (n, 1).
        alpha: Baumgarte's, in 1/s.
    """
    p, w = eq.problem, v * v
    re, im = constant(eq.C.real), constant(eq.C.imag)
    cc, cs = c @ c.T + s @ s.T, c @ s.T - s @ c.T
    M = re * cc - im * cs + constant(np.diag(eq.inertia[:, 0]))
    f = constant(eq.weight.imag) * c - constant(eq.weight.real) * s + (re * cs + im * cc) @ w
    if p.spring:
        (row, const), stiffness, rest = eq.spring, *p.spring[3:]
        x, y = constant(row.real[:, None]), constant(row.imag[:, None])
        dx = p.spring[2].real - const.real - x.T @ c + y.T @ s
        dy = p.spring[2].imag - const.imag - x.T @ s - y.T @ c
        pull = stiffness * (1 - rest / (dx * dx + dy * dy) ** 0.5)
        f = f + (-x * s - y * c) @ (pull * dx) + (x * c - y * s) @ (pull * dy)
    f = f + constant(p.torque * np.eye(eq.n)[:, :1])
    x, y = constant(eq.B.real), constant(eq.B.imag)
    G = (-x * _rows(s, eq.nc) - y * _rows(c, eq.nc), x * _rows(c, eq.nc) - y * _rows(s, eq.nc))
    gaps = x @ c - y @ s + constant(eq.B0.real), x @ s + y @ c + constant(eq.B0.imag)
    bent = x @ (c * w) - y @ (s * w), x @ (s * w) + y @ (c * w)
    rhs = [b - 2 * alpha * (J @ v) - alpha**2 * g for b, J, g in zip(bent, G, gaps, strict=True)]
    return M, f, *G, *rhs


def _rows(x: Any, n: int) -> Any:
    return np.ones((n, 1)) @ x.T


def with_casadi(problem: Problem, solver: str, alpha: float, **options: Any) -> Runner | None:
    """CVODES of casadi on v' = a(q, v), or IDAS with a and lam as algebraic unknowns."""
    ca = installed("casadi")
    if ca is None:
        return None
    eq = Equations(problem)
    n, bars = eq.n, len(problem.bars)
    q, v, a = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("a", n)
    lam = ca.SX.sym("lam", 2 * eq.nc)
    M, f, *rest = terms(eq, ca.SX, ca.cos(q), ca.sin(q), v, alpha)
    G, rhs = (ca.vertcat(*rest[:2]), ca.vertcat(*rest[2:])) if eq.nc else (ca.SX(0, n), ca.SX(0, 1))
    start = problem.absolute(problem.start())
    x0 = np.concatenate([start, np.zeros(n)])
    if solver == "idas":
        dae = {"x": ca.vertcat(q, v), "ode": ca.vertcat(v, a), "z": ca.vertcat(a, lam)}
        dae["alg"] = ca.vertcat(M @ a - f - G.T @ lam, G @ a - rhs)
        z0 = np.concatenate(eq.acceleration(start, np.zeros(n)))
    else:
        K = ca.vertcat(ca.horzcat(M, G.T), ca.horzcat(G, ca.SX(2 * eq.nc, 2 * eq.nc)))
        dae = {"x": ca.vertcat(q, v), "ode": ca.vertcat(v, ca.ldl_solve(ca.vertcat(f, rhs), *ca.ldl(K, False))[:n])}
        z0 = np.zeros(0)
    grid = np.linspace(0, problem.end, SAMPLES + 1)[1:]
    fixed = {"max_num_steps": STEPS, **options}
    if shutil.which("gcc"):
        fixed |= {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O2"], "cleanup": False}}
        fixed |= {"jit_cleanup": False}

    @cache
    def integrator(rtol: float) -> Any:
        return ca.integrator("F", solver, dae, 0, grid, {"reltol": rtol, "abstol": rtol, **fixed})

    def run(rtol: float) -> Run | None:
        with tempfile.TemporaryDirectory() as folder, chdir(folder):  # where casadi writes its C
            F = integrator(rtol)
            try:
                started = perf_counter()
                x = F(x0=x0, z0=z0)["xf"]
                seconds = perf_counter() - started
            except RuntimeError:
                return None
        theta = np.array(x)[:bars].T
        return Run(seconds, problem.relative(theta[-1]), problem.gap(theta)) if np.isfinite(theta).all() else None

    return run


def with_diffrax(problem: Problem, alpha: float) -> Runner | None:
    """Dopri8 of diffrax, compiled before it is timed."""
    diffrax = installed("diffrax")
    if diffrax is None:
        return None
    import jax
    import jax.numpy as jnp

    n, rate = len(problem.bars), rate_in_jax(problem, alpha)
    y0 = jnp.concatenate([jnp.asarray(problem.absolute(problem.start())), jnp.zeros(n)])
    grid = jnp.linspace(0, problem.end, SAMPLES + 1)[1:]

    @jax.jit
    def solve(rtol: Any) -> Any:
        control = diffrax.PIDController(rtol=rtol, atol=rtol)
        settings = {"stepsize_controller": control, "saveat": diffrax.SaveAt(ts=grid), "max_steps": STEPS}
        term, first = diffrax.ODETerm(rate), jnp.asarray(1e-4 * problem.end)
        return diffrax.diffeqsolve(
            term, diffrax.Dopri8(), 0.0, problem.end, first, y0, adjoint=diffrax.ForwardMode(), throw=False, **settings
        ).ys

    solve(1e-2).block_until_ready()

    def run(rtol: float) -> Run | None:
        started = perf_counter()
        ys = solve(float(rtol)).block_until_ready()
        seconds = perf_counter() - started
        theta = np.asarray(ys)[:, :n]
        return Run(seconds, problem.relative(theta[-1]), problem.gap(theta)) if np.isfinite(theta).all() else None

    return run


def rate_in_jax(problem: Problem, alpha: float) -> Callable[[Any, Any, Any], Any]:
    """Return (t, y, args) -> y' of absolute angles and their rates y = (theta, omega), in double precision."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    eq = Equations(problem)
    n, nc = eq.n, 2 * eq.nc

    def rate(t: Any, y: Any, args: Any) -> Any:
        q, v = y[:n, None], y[n:, None]
        M, f, *rest = terms(eq, jnp.asarray, jnp.cos(q), jnp.sin(q), v, alpha)
        if not nc:
            return jnp.concatenate([y[n:], jnp.linalg.solve(M, f)[:, 0]])
        G = jnp.concatenate(rest[:2])
        K = jnp.block([[M, -G.T], [G, jnp.zeros((nc, nc))]])
        return jnp.concatenate([y[n:], jnp.linalg.solve(K, jnp.concatenate([f, *rest[2:]]))[:n, 0]])

    return rate
