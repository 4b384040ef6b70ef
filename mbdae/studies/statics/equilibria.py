"""All equilibria of a mechanism with one freedom, on the curve of its poses."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from ...errors import InputError, StepError, several
from ...mechanism import Mechanism
from ...mechanism.formulations.balance import Balance, Statics
from ...solution.problem import mechanism_of
from ...system import Array
from ..kinematics.kinematics import kinematics
from .equilibrium import Equilibrium, labels, velocities
from .search import Search
from .stability import verdict

__all__ = ["equilibria"]

POINTS = 361
ALIKE = 1e-7  # rad or m: poses so near are one


def equilibria(
    mech: Mechanism | str | Path,
    drive: str,
    *,
    span: tuple[float, float] | None = None,
    hold: str | Iterable[str] = (),
) -> list[Equilibrium]:
    """Find all equilibria on a branch of a mechanism with one freedom: the zeros of Z^T f along its curve of poses.

    Args:
        mech: the mechanism, or what `mbdae.load` takes.
        drive: the joint over which the curve is followed, see `mbdae.kinematics`.
        span: its range in rad or m; one turn to both sides of the start when left out.
        hold: joints that stand still.

    Returns:
        The equilibria, stable and unstable ones, along the curve; for a full turn each once.

    Raises:
        InputError: where drivers or integrators leave no freedom, and as `mbdae.kinematics`.
        UnknownNameError, AssemblyError, StepError: as `mbdae.kinematics`.
    """
    mech = mechanism_of(mech, "equilibria")
    held = several(hold, "hold is a list of joints")
    curve = kinematics(mech, drive, span=span, hold=tuple(held), points=POINTS)
    fixed = np.array([i for name in held for i in velocities(mech, name)], int)
    statics, names = Statics(mech, 0.0, np.zeros(mech.nv), fixed), labels(mech, fixed)
    s0, manifold = np.array(list(mech.states.values())), statics.system.manifold

    if statics.point(curve.q[0], s0).free.Z.shape[1] != 1:
        raise InputError(f"a driver or an integrator says where {drive!r} is: there is no branch of equilibria over it")

    def along(here: Balance, tangent: Array) -> float:
        U = here.free.U
        side = np.sign((U @ tangent) @ (U @ here.free.Z[:, 0]))
        return float(side * here.rho[0])

    def point(q: Array) -> Balance:
        return statics.point(statics.close(q, s0), s0)

    out: list[Equilibrium] = []
    for stretch in curve.stretches:
        at = range(stretch.first, stretch.last - 1)
        met = [point(q) for q in curve.q[stretch.first : stretch.last]]
        values = [along(here, tau) for here, tau in zip(met, curve.tangent[stretch.first :], strict=False)]
        for i, a, b in zip(at, values, values[1:], strict=False):
            if a * b > 0 or b == 0:
                continue
            x, tau = manifold.difference(curve.q[i], curve.q[i + 1]), curve.tangent[i]
            try:
                share = brentq(
                    lambda c, i=i, x=x, tau=tau: along(point(manifold.integrate(curve.q[i], c * x)), tau), 0, 1
                )
                search = Search(statics, point(manifold.integrate(curve.q[i], share * x)))
                found = search.run("any")
            except (StepError, ValueError):
                continue
            here = search.here
            apart = [np.abs(_wrapped(manifold.difference(e.q, here.q))).max() for e in out]
            if found and min(apart, default=1.0) > ALIKE:
                still, holding = np.zeros(mech.nv), dict(zip(names, here.holding.tolist(), strict=True))
                out.append(
                    Equilibrium(
                        mech, 0.0, here.q, still, here.s, here.lam, holding, search.residual, search.iterations,
                        verdict(statics, here),
                    )
                )  # fmt: skip
    return out


def _wrapped(x: Array) -> Array:
    return x - 2 * np.pi * np.round(x / (2 * np.pi))
