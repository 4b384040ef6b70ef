"""Mechanisms and error measures shared by the tests of formulations."""

import numpy as np
from chains import random_q, tree
from shared import shared_model

import mbdae
from mbdae import Closure, Mechanism
from mbdae.mechanism.time_functions.time_functions import Constant

ALL = [{}, {"project": True}, {"formulation": "ggl"}, {"formulation": "index1", "method": "DOP853"}]
FAR = 1e6  # s: the smallest step is relative to the span, so that a failing run tries fewer steps


def free_loop():
    """Return a free-flying loop of spherical, continuous and revolute joints."""
    model = tree(["free", "spherical", "continuous", "revolute", "spherical"], [0, 1, 2, 1, 4], seed=3)
    return Mechanism(model, closures=[Closure.point("tip_2", "tip_4")], title="free loop")


def start_of(mech):
    if mech.title != "free loop":
        return mech.start
    rng = np.random.default_rng(0)
    return mech.assemble(random_q(mech.model, rng, 0.5), rng.uniform(-1, 1, mech.nv))


def model(name):
    return free_loop() if name == "free_loop" else shared_model(name)


def run(mech, T, **options):
    sol = mbdae.solve(mech, (0.0, T), *start_of(mech), **options)
    assert sol.ended, sol.message
    return sol


def frozen(mech, t=0.0):
    """Return the same mechanism with functions of time in its forces held at their values at a time."""
    forces = [f.model_copy(update={k: Constant(value=x.at(t)) for k, x in f if hasattr(x, "at")}) for f in mech.forces]
    return Mechanism(mech.model, mech.closures, forces, drivers=mech.drivers, start=mech.start_values, title=mech.title)


def levels(sol):
    """Return largest |g| and |G v| over all rows and times after the start."""
    system, levels = sol.mechanism.system(), []
    for q, v in zip(sol.q[1:], sol.v[1:], strict=True):
        g, G = system.closures(q)
        levels.append((np.abs(g).max(), np.abs(G @ v).max()))
    return tuple(np.max(levels, axis=0))


def distance(mech, a, b, times=1):
    """Return largest differences of q and v of two runs at common times, the end among them."""
    (qa, va), (qb, vb) = ((x[:: -((len(x) - 1) // times)][:times] for x in (s.q, s.v)) for s in (a, b))
    turn = [np.abs(mech.manifold.difference(x, y)).max() for x, y in zip(qa, qb, strict=True)]
    return max(turn), np.abs(va - vb).max()


def slopes(mech, T, steps, **options):
    """Return observed orders of q and v: errors at ten times, least squares."""
    reference = run(mech, T, method="pherk6", step=T / (2 * steps[-1]))
    errors = [distance(mech, reference, run(mech, T, step=T / n, **options), 10) for n in steps]
    return [-np.polyfit(np.log2(steps), np.log2(e), 1)[0] for e in np.array(errors).T]
