"""A solution as named columns over time, for tables and plots."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError
from ..mechanism import Reaction, joint_reaction, loaded, loads, reaction
from ..mechanism.contacts import contact, path, rolling
from ..mechanism.frames import find_joint
from ..system import Array
from .sampling import kept

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .solution import Solution

TURN = 2 * np.pi
CONTACT = ("normal", "longitudinal", "lateral", "friction")
LOADS, WORLD_AXES, OWN_AXES = ("force", "torque"), "xyz", "123"
RESTING = 1e-10  # rad/s or m/s: of what does not move, energies are rounding
PARTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # joint: names of the coordinates in q and in v
    "Translation": (("x", "y", "z"), ("x", "y", "z")),
    "Spherical": (("qx", "qy", "qz", "qw"), ("wx", "wy", "wz")),
    "FreeFlyer": (("x", "y", "z", "qx", "qy", "qz", "qw"), ("vx", "vy", "vz", "wx", "wy", "wz")),
    "Planar": (("x", "y", "cos", "sin"), ("vx", "vy", "wz")),
    "Universal": (("1", "2"), ("1", "2")),
}


class Residuals(NamedTuple):
    """What a run keeps or should keep, at the times of a solution.

    Attributes:
        g: position residuals of all rows (m, or rad for directions), (n, ng).
        Gv: velocity residuals G v + g_t of all rows (m/s, rad/s), (n, ng).
        kinetic: kinetic energy in J, (n,).
        potential: potential energy of gravity and springs in J, (n,).
    """

    g: Array
    Gv: Array
    kinetic: Array
    potential: Array


def balance(v: Array, kinetic: Array, potential: Array, work: Array) -> tuple[Array, float]:
    """|E - E_0 - W| in J, (n,), and the energy that it is compared with: 0 where nothing moves.

    Args:
        v: velocities, (n, nv).
        kinetic: kinetic energy in J, (n,).
        potential: potential energy in J, (n,).
        work: work of non-conservative forces in J, (n,).
    """
    done, total = work - work[0], kinetic + potential
    scale = max(np.abs(done).max(), kinetic.max(), np.ptp(potential))
    resting = np.abs(v).max(initial=0.0) <= RESTING
    return np.abs(total - total[0] - done), 0.0 if resting else float(scale)


def residuals(sol: "Solution") -> Residuals:
    """Evaluate the closures and the energies of a mechanism's solution at its times.

    Raises:
        InputError: for a solution of a textbook problem, or one without times.
    """
    mech = sol.mechanism
    if not len(sol.t):
        raise InputError(f"the solution of {mech.title!r} has no times: the run ended before the first of t_eval")
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that explodes
        g, Gv, energies = kept(sol)
    return Residuals(g, Gv, *energies.T)


def signals(sol: "Solution", *, lam: bool = True) -> dict[str, Array]:
    """Return named columns of equal length: ``pandas.DataFrame(sol.signals())`` is a table.

    ``t`` in s; ``q.<joint>`` and ``v.<joint>`` (rad or m, per s), with a part behind the name where a joint has several
    coordinates (``q.base.x``, ``v.base.wz``); unbounded revolute joints as one angle, unwrapped over the run;
    ``contact.<closure>.x``, ``.y``, ``.z`` in m where bodies roll; ``s.<state>`` of forces that have states of their
    own; ``lam.<closure>.<row>`` with rows counted from 1 (N, N m; from the hidden constraint); of rolling bodies
    ``normal.<closure>``, ``longitudinal.<closure>`` and ``lateral.<closure>`` in N, and ``friction.<closure>``, the
    coefficient that it takes not to slip; ``a.<joint>``, accelerations, named as velocities; ``force.<name>`` and
    ``torque.<name>`` (N, N m) of joints, and of closures and driven distances between frames: the magnitude, and with
    ``.x .y .z`` behind it the components along the world's axes, with ``.1 .2 .3`` along its own, see
    `mbdae.mechanism.joint_wrenches.loads`; ``kinetic``, ``potential``, ``energy`` = kinetic + potential, and ``work``
    of the non-conservative forces and drivers in J; ``g`` and ``Gv``, the largest |g| and |G v + g_t| over all rows.

    Args:
        sol: the solution.
        lam: whether multipliers, accelerations, forces and torques are among them; they cost more than all others.

    Raises:
        InputError: for a solution of a textbook problem.
    """
    mech, r = sol.mechanism, residuals(sol)
    out = {"t": np.asarray(sol.t)}
    out |= coordinates(sol)
    for closure in rolling(mech):
        points = path(mech, closure.name, sol.q)
        out |= {f"contact.{closure.name}.{x}": column for x, column in zip("xyz", points.T, strict=True)}
    out |= {f"s.{name}": sol.y[:, mech.nq + mech.nv + i] for i, name in enumerate(mech.states)}
    if lam:
        out |= {name: sol.lam[:, i] for i, name in enumerate(row_names(mech))}
        for closure in rolling(mech):
            out |= contact_forces(sol, closure.name)
        out |= {name: sol.vdot[:, i] for i, name in enumerate(acceleration_names(mech))}
        out |= load_columns(mech, loads(mech, sol.t, sol.q, sol.v, sol.vdot, sol.lam))
    energy = r.kinetic + r.potential
    out |= {"kinetic": r.kinetic, "potential": r.potential, "energy": energy, "work": sol.work}
    for name, rows in (("g", r.g), ("Gv", r.Gv)):
        out[name] = np.abs(rows).max(axis=1, initial=0.0)
    return out


def contact_forces(sol: "Solution", name: str) -> dict[str, Array]:
    """Return the columns of `signals` that a rolling closure has with its multipliers."""
    found = contact(sol.mechanism, name, sol.t, sol.q, sol.lam)
    return {f"{kind}.{name}": getattr(found, kind) for kind in CONTACT}


def contact_names(mech: "Mechanism") -> list[str]:
    """Names of all columns of rolling closures."""
    names = [c.name for c in rolling(mech)]
    return [f"contact.{n}.{x}" for n in names for x in "xyz"] + [f"{kind}.{n}" for n in names for kind in CONTACT]


def coordinates(sol: "Solution") -> dict[str, Array]:
    """Return the columns ``q.*`` and then ``v.*`` of `signals`."""
    mech = sol.mechanism
    q: dict[str, Array] = {}
    v: dict[str, Array] = {}
    for name in mech.joint_names:
        joint, kind = find_joint(mech.model, name), mech.joint_kind(name)
        qs, vs = sol.q[:, joint.idx_q : joint.idx_q + joint.nq], sol.v[:, joint.idx_v : joint.idx_v + joint.nv]
        if (joint.nq, joint.nv) == (2, 1):
            q[f"q.{name}"] = unwrapped(sol, joint.idx_q, joint.idx_v)
            v[f"v.{name}"] = vs[:, 0]
            continue
        for letter, columns, out, side in (("q", qs, q, 0), ("v", vs, v, 1)):
            numbers = tuple(str(k + 1) for k in range(columns.shape[1]))
            parts = PARTS[kind][side] if kind in PARTS else numbers
            for part, column in zip(parts, columns.T, strict=True):
                out[f"{letter}.{name}" + (f".{part}" if len(parts) > 1 else "")] = column
    return {**q, **v}


def units(mech: "Mechanism") -> dict[str, str]:
    """Units of the columns ``q.*`` and ``v.*`` of `signals`: rad or m, and per s; 1 for parts of quaternions."""
    out = {}
    for name in mech.joint_names:
        joint, kind = find_joint(mech.model, name), mech.joint_kind(name)
        own = "m" if kind.startswith("P") and kind != "Planar" else "rad"
        single = (joint.nq, joint.nv) in ((1, 1), (2, 1))
        parts = ((name,), (name,)) if single else PARTS.get(kind, ((), ()))
        for letter, side, per in (("q", parts[0], ""), ("v", parts[1], "/s")):
            for part in side:
                length = part.removeprefix("v") in ("x", "y", "z") or (single and own == "m")
                pure = part in ("qx", "qy", "qz", "qw", "cos", "sin")
                unit = "m" if length else "1" if pure else "rad"
                out[f"{letter}.{name}" + ("" if single else f".{part}")] = unit + per
    return out


def row_names(mech: "Mechanism") -> list[str]:
    """Names ``lam.<closure>.<row>`` of the rows of all closures, rows counted from 1."""
    counts: dict[str, int] = {}
    names = []
    for i in range(mech.ng):
        closure = mech.row_closure(i)
        counts[closure] = counts.get(closure, 0) + 1
        names.append(f"lam.{closure}.{counts[closure]}")
    return names


def reaction_of(sol: "Solution", name: str) -> Reaction:
    """Return the reaction of a closure, or of a joint that has its name alone, see `Solution.reaction`."""
    mech = sol.mechanism
    if name in mech.joint_names and name not in mech.row_names:
        return joint_reaction(mech, name, sol.t, sol.q, sol.v, sol.vdot, sol.lam)
    return reaction(mech, name, sol.t, sol.q, sol.lam)


def acceleration_names(mech: "Mechanism") -> list[str]:
    """Names ``a.<joint>`` of the components of v'."""
    return [f"a.{name[2:]}" for name in units(mech) if name.startswith("v.")]


def load_names(mech: "Mechanism") -> list[str]:
    """Names of the columns of forces and torques."""
    words = [f"{word}.{name}" for name in loaded(mech) for word in LOADS]
    return [word + part for word in words for part in ("", *(f".{axis}" for axis in (*WORLD_AXES, *OWN_AXES)))]


def load_columns(mech: "Mechanism", found: tuple[Array, Array]) -> dict[str, Array]:
    """Columns of forces and torques along the world's axes and along their own, (n, k, 6) each, see `loads`."""
    n = len(found[0])
    world, own = (x.reshape(n, -1, 3) for x in found)
    all_of = np.concatenate([np.linalg.norm(world, axis=2)[:, :, None], world, own], axis=2)
    return dict(zip(load_names(mech), all_of.reshape(n, -1).T, strict=True))


def unwrapped(sol: "Solution", iq: int, iv: int) -> Array:
    """The angle of an unbounded revolute joint (q holds its cosine and sine) at the times of a solution, in rad, (n,).

    The branch is followed from step to step along the mean velocity, so that fast turns are counted too.
    """
    ts, ys, _ = sol.nodes
    ts, ys = np.asarray(ts), np.asarray(ys)
    angle = np.arctan2(ys[:, iq + 1], ys[:, iq])
    w = ys[:, sol.mechanism.nq + iv]
    moves = np.diff(ts) * (w[1:] + w[:-1]) / 2
    for i, move in enumerate(moves):
        angle[i + 1] = _near(angle[i + 1], angle[i] + move)
    if sol.steps is None:
        return angle
    rising = slice(None) if len(ts) < 2 or ts[-1] > ts[0] else slice(None, None, -1)
    guess = np.interp(sol.t, ts[rising], angle[rising])
    return _near(np.arctan2(sol.q[:, iq + 1], sol.q[:, iq]), guess)


def _near(angle: Array, guess: Array) -> Array:
    """The angle less the whole turns that bring it nearest to a guess."""
    return angle + TURN * np.round((guess - angle) / TURN)
