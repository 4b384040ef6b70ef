"""Long-time measures of a run: change of conserved momenta, and the error of a run back to the start."""

import numpy as np

from ...errors import InputError
from ...integrate.solve import solve
from ...mechanism.signals.momentum import Momenta, momenta
from ...solution.signals import units
from ...solution.solution import Solution, uninterrupted
from ...system import Array
from ...tolerances import AGREEMENT, CLOSED
from ..method_variant import variant_from_settings

SAMPLES = 1000  # nodes at which momenta are evaluated
WORLD = tuple(f"{kind}.{x}" for kind in ("momentum", "angular_momentum.origin") for x in "xyz")


def momentum_changes(sol: Solution) -> dict[str, float]:
    """Return the largest change of each conserved momentum, relative to the largest sum of magnitudes of its terms.

    A momentum is conserved if its rate by the equations of motion, at states of the run, is rounding. Candidates are
    those of `mbdae.mechanism.signals.momentum.Momenta`: ``momentum.x``, ``angular_momentum.origin.x`` (about
    the origin of the world), and for ``v.joint`` the component ``p.joint`` of M v, conserved for a cyclic coordinate.
    Momenta whose terms are all zero are omitted.
    """
    mech = sol.mechanism
    nodes = np.unique(np.linspace(0, len(sol.t) - 1, SAMPLES).astype(int))
    found = momenta(mech.model, sol.q[nodes], sol.v[nodes], sol.vdot[nodes])
    names = [*WORLD, *(f"p.{name.removeprefix('v.')}" for name in units(mech) if name.startswith("v."))]
    span = abs(float(sol.t[-1] - sol.t[0]))
    return {name: _change(found, i) for i, name in enumerate(names) if _conserved(found, i, span)}


def _change(found: Momenta, i: int) -> float:
    return float(np.abs(found.value[:, i] - found.value[0, i]).max() / found.size[:, i].max())


def _conserved(found: Momenta, i: int, span: float) -> bool:
    """Return whether a momentum has nonzero terms, and a rate below rounding of its terms and of size over span."""
    kind = slice(3 * (i // 3), 3 * (i // 3) + 3) if i < len(WORLD) else slice(len(WORLD), None)

    def largest(x: Array) -> float:
        return float(np.abs(x).max(initial=0.0))

    size = largest(found.size[:, kind])
    fastest = largest(found.rate_size[:, kind]) + (size / span if span else 0.0)
    return largest(found.size[:, i]) > AGREEMENT * size and largest(found.rate[:, i]) <= AGREEMENT * fastest


def reversal_error(sol: Solution) -> tuple[float, float] | None:
    """Return the largest differences of q and of v at the start after a run back from the end with the same settings.

    A final configuration with constraint drift is assembled first. None if the run back ends early. The error of a
    symmetric method is rounding, if the span is a whole number of constant steps.

    Raises:
        InputError: for forces that cannot be integrated backward in time.
    """
    mech, settings = sol.mechanism, sol.settings
    control = {name: settings[name] for name in ("step", "rtol", "atol") if name in settings}
    q, v, s = sol.q[-1], sol.v[-1], sol.s[-1]
    span = (float(sol.t[-1]), float(sol.t[0]))
    if np.abs(mech.residual(q, v, span[0])[0]).max(initial=0.0) > CLOSED:
        q, v = mech.assemble(q, v, t=span[0])
    back = solve(mech, span, q, v, s, **variant_from_settings(settings).arguments(), **control)
    if not uninterrupted(back).ended:
        return None
    dq = mech.manifold.difference(sol.q[0], back.q[-1])
    return float(np.abs(dq).max(initial=0.0)), float(np.abs(back.v[-1] - sol.v[0]).max(initial=0.0))


def reject_textbook(title: str) -> None:
    """Reject a textbook problem.

    Raises:
        InputError: always.
    """
    raise InputError(f"{title!r} is a textbook problem: momenta and reversal are those of mechanisms")
