"""The solvers of the stiff problems of work_precision.py. The settings are described in that script."""

from collections.abc import Callable
from functools import partial
from time import perf_counter

import numpy as np
from common import backends
from runs import Array, Run, Runner, installed
from stiff import Stiff

import mbdae


def with_mbdae(problem: Stiff, method: str, **options: object) -> Runner:
    """Methods of mbdae with step-size control."""
    mech, start = problem.model()
    at = [mech.model.joints[mech.model.getJointId(name)].idx_q for name in problem.joints]

    def run(rtol: float) -> Run | None:
        sol = mbdae.solve(mech, (0, problem.end), *start, method=method, rtol=rtol, atol=rtol, **options)
        return Run(sol.stats["seconds"], sol.q[-1][at], 0.0) if sol.success else None

    return run


def with_idas(problem: Stiff) -> Runner | None:
    """IDAS of casadi with accelerations and lam as algebraic unknowns."""
    ca = installed("casadi")
    if ca is None:
        return None
    (q0, v0), t = problem.start, ca.SX.sym("t")
    n = len(q0)
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    M, f, G, b = problem.terms(ca, t, q, v)
    lam, rows = ca.SX.sym("lam", len(b)), ca.vertcat(*(ca.horzcat(*row) for row in G)) if G else ca.SX(0, n)
    mass = ca.vertcat(*(ca.horzcat(*row) for row in M))
    alg = ca.vertcat(mass @ a - ca.vertcat(*f) - rows.T @ lam, rows @ a - ca.vertcat(*b) if b else ca.SX(0, 1))
    dae = {"t": t, "x": ca.vertcat(q, v), "z": ca.vertcat(a, lam), "ode": ca.vertcat(v, a), "alg": alg}
    fixed = {"max_num_steps": 100_000, "suppress_algebraic": True}
    z0 = np.concatenate(problem.acceleration(0.0, np.array(q0), np.array(v0)))

    def run(rtol: float) -> Run | None:
        F = ca.integrator("F", "idas", dae, 0, problem.end, {"reltol": rtol, "abstol": rtol, **fixed})
        try:
            started = perf_counter()
            x = F(x0=[*q0, *v0], z0=z0)["xf"]
            seconds = perf_counter() - started
        except RuntimeError:
            return None
        return Run(seconds, np.array(x)[list(problem.seen), 0], 0.0)

    return run


def with_solve_dae(problem: Stiff) -> Runner | None:
    """Radau of solve_dae on the equations with index 1, lam as the rate of an unknown; Jacobian by differences."""
    package = installed("solve_dae.integrate")
    if package is None:
        return None
    (q0, v0), n = problem.start, len(problem.start[0])
    a0, lam0 = problem.acceleration(0.0, np.array(q0), np.array(v0))
    m = len(lam0)

    def residual(t: float, y: Array, yp: Array) -> Array:
        M, f, G, b = (np.array(x, float) for x in problem.terms(np, t, y[:n], y[n : 2 * n]))
        G = G.reshape(m, n)
        return np.concatenate([yp[:n] - y[n : 2 * n], M @ yp[n : 2 * n] - f - G.T @ yp[2 * n :], G @ yp[n : 2 * n] - b])

    def run(rtol: float) -> Run | None:
        y0, yp0 = np.concatenate([q0, v0, np.zeros(m)]), np.concatenate([v0, a0, lam0])
        started = perf_counter()
        sol = package.solve_dae(residual, (0, problem.end), y0, yp0, method="Radau", rtol=rtol, atol=rtol)
        seconds = perf_counter() - started
        return Run(seconds, sol.y[list(problem.seen), -1], 0.0) if sol.success else None

    return run


def with_exudyn(problem: Stiff) -> Runner | None:
    """Generalized alpha of Exudyn as the trapezoidal rule on index 2."""
    exu = installed("exudyn")
    if exu is None:
        return None
    from exudyn_model import settings
    from exudyn_stiff import MODELS

    def run(step: float) -> Run | None:
        mbs = exu.SystemContainer().AddSystem()
        seen = MODELS[problem.title](exu, mbs)
        mbs.Assemble()
        s = settings(exu, problem.end, step)
        started = perf_counter()
        mbs.SolveDynamic(s)
        seconds = perf_counter() - started
        start = mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Reference)
        return Run(seconds, (mbs.systemData.GetODE2Coordinates() + start)[seen], 0.0)

    return run


def stiff_solvers(problem: Stiff) -> dict[str, tuple[Callable[[Stiff], Runner | None], bool]]:
    """Return by name: the factory of the runner, and whether it takes steps instead of tolerances."""
    fast = backends()[-1]
    ours = {name: partial(with_mbdae, method=name, backend=fast) for name in ("radau5", "radau9", "pherk5")}
    others = {"casadi IDAS": (with_idas, False), "solve_dae Radau": (with_solve_dae, False)}
    return {name: (make, False) for name, make in ours.items()} | others | {"Exudyn": (with_exudyn, True)}
