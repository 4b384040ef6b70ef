"""Runs with the steps of another run, and derivatives by differences, as references for tangents."""

from functools import cache

import numpy as np

import mbdae
from mbdae import finite_differences
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.system import State

SLIPS = {"start.v.crank": 1.0}
FROZEN = [  # model, parameters, other values, span in s, mode
    ("pendulum_on_stop", {"body.rod.mass": 2.0}, {}, 0.2, (0,)),  # open
    ("slider_crank_with_stop", {"body.rod.mass": 0.5}, {}, 0.05, (0,)),
    ("bouncing_chain", {"gravity.2": -9.81}, {}, 0.05, (0,) * 8),
    ("ratchet", {"gravity.2": -9.81, "body.wheel.mass": 1.0}, {}, 0.03, (0, 1)),  # a pawl is engaged
    ("stick_slip_slider", {"body.rod.xyz.0": 0.1, "gravity.2": -9.0}, {}, 0.04, (1, 1)),  # both stick: no motion
    ("stick_slip_slider", {"body.rod.xyz.0": 0.1, "force.joint_friction 3.friction": 2.0}, SLIPS, 0.04, (2, 3)),
]  # fmt: skip


def difference(mech, a, b):
    """Return difference of points a to b in the tangent, (n, ny)."""
    turns = [mech.manifold.difference(x[: mech.nq], y[: mech.nq]) for x, y in zip(a, b, strict=True)]
    return np.hstack([np.array(turns), b[:, mech.nq :] - a[:, mech.nq :]])


def quotient(run, value, width, mech=None):
    """Return derivative of order six of run(value + k h), points (n, ...) or other numbers."""
    h = width * (abs(value) or 1.0)
    if mech is None:
        return finite_differences.numerical_derivative(lambda x: run(value + x), h)
    base = run(value)
    return finite_differences.numerical_derivative(lambda x: difference(mech, base, run(value + x)), h)


WIDTHS = (3e-4, 1e-3, 3e-3)


def assert_derivative(found, run, value, within, widths=WIDTHS, mech=None, what=""):
    """Check that a derivative agrees with the quotient of some width, widest first: truncation or rounding limits it.

    Errors are relative to the largest entry, or to 1.
    """
    run, errors = cache(run), []
    for width in reversed(widths):
        expected = quotient(run, value, width, mech)
        errors.append(np.abs(found - expected).max() / max(1.0, np.abs(expected).max()))
        if errors[-1] < within:
            return
    raise AssertionError(f"{what}: errors {errors}, expected below {within}")


def runs_of(model, name, T, **options):
    """Return the template of a model, the value of a parameter, and value -> run."""
    template = Template(model)

    @cache
    def run(value):
        sol = mbdae.solve(template.make({name: value}), (0.0, T), **options)
        assert sol.ended, sol.message
        return sol

    return template, parameter_value(template, name), run


def free_velocity(mech):
    """Return a direction (nv,) in which closures let the initial velocity vary; 0 without a degree of freedom."""
    q, v = mech.start
    free = mech.assemble(q, v + np.random.default_rng(1).standard_normal(mech.nv))[1] - v
    return free / max(np.abs(free).max(), 1e-3)


def repeated_run(trajectory, mech, start=None):
    """Return points of a mechanism recomputed with the steps of a run, from its start or another point, (n, ...)."""
    system, tableau, t = mech.system(), trajectory.tableau, trajectory.ts
    y = mech.point() if start is None else start
    if trajectory.project:
        y = system.project_state(t[0], y)
    carry = system.carry(*system.derivative(t[0], y)) if trajectory.n_carry else None
    out, state = [y], State(y, carry)
    for i, h in enumerate(np.diff(t)):
        rows = next((r for first, r in reversed(trajectory.sol.in_use) if first <= i), None)
        if rows:
            system.use_rows(rows)
        parts = (h / 2, h / 2) if trajectory.controlled and not tableau.b_embedded else (h,)
        at = t[i]
        for part in parts:
            state, at = tableau.step(system, at, part, state).state, at + part
        if trajectory.project:
            y = system.project_state(t[i + 1], state.y)
            carry = system.carry(*system.derivative(t[i + 1], y)) if trajectory.restarted[i + 1] else state.carry
            state = State(y, carry)
        out.append(state.y)
    return np.array(out)


def compare(sol, names, signals, **options):
    """Check <w, J u> = <J^T w, u> for random weights of signals."""
    found, rng = mbdae.sensitivity(sol, names, **options), np.random.default_rng(0)
    weights = {name: rng.standard_normal(len(sol.t)) for name in signals}

    def cost(values):
        return sum(float(w @ values[name]) for name, w in weights.items()), weights

    adjoint = np.array(list(mbdae.gradient(sol, cost, names, **options).gradient.values()))
    derivatives = {name: found.signal(name) for name in signals}
    tangent = sum(w @ derivatives[name] for name, w in weights.items())
    size = sum(np.abs(w) @ np.abs(derivatives[name]) for name, w in weights.items())
    assert (np.abs(tangent - adjoint) <= 1e-13 * size.max()).all()
    assert size.max() > 0
