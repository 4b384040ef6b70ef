"""Panes: the signals that are plotted beside a replay, grouped by unit, thinned to what a screen can show."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import InputError, as_list
from ...solution.signals import find, signals, units
from ...system import Array
from ...tolerances import BELOW_ROUNDING
from ..figures import QUANTITY_NAMES

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...solution.solution import Solution

Signal = Callable[[float, Array, Array], float] | Sequence[float] | Array
Plot = str | Sequence[str]
POINTS = 1500  # more than a curve has pixels
MOST = 7  # curves of one pane that can be told apart
STEPPED = ("energy", "work", "g", "Gv")  # errors of a run are shown at its steps: between them is interpolation
WORDS = {**QUANTITY_NAMES, "m, rad": "|g|", "m/s, rad/s": "|G v|"}


class Curve(NamedTuple):
    """A signal over time: t and y (n,); ``ghost`` counts the other solutions from 0, -1 is the one that is shown."""

    name: str
    t: Array
    y: Array
    ghost: int = -1


@dataclass(frozen=True)
class PlotPanel:
    """Curves over one pair of axes.

    Attributes:
        title: the quantity, with its unit.
        curves: of the solution and of its ghosts.
        logarithmic: whether the ordinate is.
        cut: where a logarithmic ordinate begins, with rounding below; 0 for the least value.
    """

    title: str
    curves: tuple[Curve, ...]
    logarithmic: bool = False
    cut: float = 0.0


def panes(
    sol: "Solution", plots: str | Sequence[Plot] | None, own: Mapping[str, Signal], ghosts: Iterable["Solution"] = ()
) -> list[PlotPanel]:
    """Return the panes of a solution, one for each entry and unit.

    Args:
        sol: the solution.
        plots: entries, each a name of `Solution.signals`, the beginning of several (``"q"``, ``"lam.pin"``), or
            several of both; joint coordinates, energies and |g| when left out.
        own: signals by name: functions of (t, q, v), or arrays over ``sol.t``. Those not in ``plots`` follow.
        ghosts: other solutions, for the same curves.

    Raises:
        UnknownNameError: for a name that does not exist.
        InputError: for an own signal of another length, or one that hides a column.
    """
    if plots is not None and not plots and not own:
        return []
    mech = sol.mechanism
    chosen = [_expanded(entry, own, mech) for entry in _entries(plots)]
    wanted = [*_columns(chosen, own, mech), *(() if plots else ("kinetic", "potential"))]
    table = _table(sol, own, wanted)
    groups = _defaults(table, mech) if plots is None else [_Group(tuple(dict.fromkeys(names))) for names in chosen]
    groups += _others(groups, own)
    functions = {name: signal for name, signal in own.items() if callable(signal)}
    tables = [table, *(_table(ghost, functions, wanted) for ghost in ghosts)]
    found = [pane for group in groups for pane in _by_unit(group, tables, mech)]
    return [_as_read(pane) for pane in found] if plots is None else found


class _Group(NamedTuple):
    names: tuple[str, ...]
    note: str = ""


def _entries(plots: str | Sequence[Plot] | None) -> list[tuple[str, ...]]:
    what = "plots is a list of signals, or of lists of them"
    return [tuple(as_list(entry, what)) for entry in as_list(plots or (), what)]


def _expanded(entry: Sequence[str], own: Mapping[str, Signal], mech: "Mechanism") -> list[str]:
    """The signals of an entry, whose names may be the beginning of several."""
    return [signal for name in entry for signal in ([name] if name in own else find(mech, name))]


def _columns(chosen: Sequence[Sequence[str]], own: Mapping[str, Signal], mech: "Mechanism") -> list[str]:
    """Columns of the solution that are chosen, and all coordinates."""
    coordinates = [name for name in units(mech) if name.startswith("q.")]
    return [*(name for entry in chosen for name in entry if name not in own), *coordinates]


def _others(groups: Sequence[_Group], own: Mapping[str, Signal]) -> list[_Group]:
    """Signals of the user that are in no group: one for each."""
    grouped = {name for group in groups for name in group.names}
    return [_Group((name,)) for name in own if name not in grouped]


def _defaults(table: Mapping[str, Curve], mech: "Mechanism") -> list[_Group]:
    """Coordinates by unit except for quaternions, energies, and the largest |g|."""
    unit = {n: u for n, u in units(mech).items() if n.startswith("q.") and u != "1"}  # quaternions say little
    by_unit = [_liveliest(table, [n for n in unit if unit[n] == u]) for u in dict.fromkeys(unit.values())]
    return [*by_unit, _Group(("kinetic", "potential", "energy")), *([_Group(("g",))] if mech.ng else [])]


def _liveliest(table: Mapping[str, Curve], names: list[str]) -> _Group:
    """At most `MOST` names, those whose values spread the most."""
    if len(names) <= MOST:
        return _Group(tuple(names))
    spread = {name: float(np.ptp(table[name].y)) for name in names}
    best = sorted(names, key=lambda name: -spread[name])[:MOST]
    return _Group(tuple(n for n in names if n in best), f", {MOST} of {len(names)} that move the most")


def _by_unit(group: _Group, tables: Sequence[Mapping[str, Curve]], mech: "Mechanism") -> list[PlotPanel]:
    known = units(mech)
    unit = {name: known.get(name, name) for name in group.names}  # a user's signal has its own pane
    out = []
    for kind in dict.fromkeys(unit.values()):
        names = [name for name in group.names if unit[name] == kind]
        curves = [t[n]._replace(ghost=k - 1) for k, t in enumerate(tables) for n in names if n in t]
        word = names[0] if len(names) == 1 and names[0] not in ("g", "Gv") else WORDS.get(kind, kind)
        title = f"{word} ({kind}){group.note}" if kind not in ("", "1", word) else word + group.note
        drift = set(names) <= {"g", "Gv"}
        out.append(PlotPanel(title, _short(curves), drift, BELOW_ROUNDING if drift else 0.0))
    return out


def _short(curves: Sequence[Curve]) -> tuple[Curve, ...]:
    """Names without the beginning that all have in common: the title says it."""
    heads = {c.name.partition(".")[0] for c in curves}
    same_head = len(heads) == 1 and all("." in c.name for c in curves)
    return tuple(c._replace(name=c.name.partition(".")[2]) if same_head else c for c in curves)


def _as_read(pane: PlotPanel) -> PlotPanel:
    """A pane as one reads it: angles of joints that turn between -pi and pi, potential energy from where it starts."""
    if pane.title.startswith("energies"):
        zero = next((c.y[0] for c in pane.curves if c.name == "potential" and c.ghost < 0), 0.0)
        moved = tuple(c if c.name == "kinetic" else c._replace(y=c.y - zero) for c in pane.curves)
        return replace(pane, title="energies (J), potential from its start", curves=moved)
    if "(rad)" not in pane.title or not any(np.ptp(c.y) > 2 * np.pi for c in pane.curves):
        return pane
    angular = {c.name for c in pane.curves if np.ptp(c.y) > 2 * np.pi}
    wrapped = tuple(_wrapped(c) if c.name in angular else c for c in pane.curves)
    return replace(pane, title=pane.title.replace("(rad)", "(rad), within π"), curves=wrapped)


def _wrapped(curve: Curve) -> Curve:
    """An angle in [-pi, pi), broken where it jumps."""
    y = (curve.y + np.pi) % (2 * np.pi) - np.pi
    jumps = np.flatnonzero(np.abs(np.diff(y)) > np.pi) + 1
    near = np.abs(curve.t[:, None] - (curve.t[jumps - 1] + curve.t[jumps]) / 2).min(axis=1, initial=np.inf)
    return curve._replace(y=np.where(near < np.ptp(curve.t) / 400, np.nan, y))


def _table(sol: "Solution", own: Mapping[str, Signal], wanted: Sequence[str]) -> dict[str, Curve]:
    """Curves of a solution by name, smooth ones at uniform times, the others at its steps; those that are wanted."""
    few = np.unique(np.linspace(0, len(sol.t) - 1, min(len(sol.t), POINTS)).astype(int))
    steps = replace(sol, t=sol.t[few], y=sol.y[few], z_own=sol.z_own[few], steps=sol.nodes)
    smooth = sol.resampled(np.linspace(sol.t[0], sol.t[-1], POINTS)) if len(sol.t) > 1 else steps
    table = {name: Curve(name, smooth.t, values) for name, values in signals(smooth, wanted).items()}
    table |= {name: Curve(name, steps.t, values) for name, values in signals(steps, STEPPED).items()}
    for name, signal in own.items():
        if name in units(sol.mechanism):
            raise InputError(f"a signal needs another name, {name!r} is a column of the solution")
        table[name] = _own(name, signal, sol, smooth)
    return table


def _own(name: str, signal: Any, sol: "Solution", smooth: "Solution") -> Curve:
    if callable(signal):
        t, values = smooth.t, [signal(*point) for point in zip(smooth.t, smooth.q, smooth.v, strict=True)]
    else:
        t, values = sol.t, signal
    try:
        y = np.asarray(values, float)
    except (TypeError, ValueError):
        raise InputError(f"signal {name!r} must give numbers") from None
    if y.shape != (len(t),):
        raise InputError(f"signal {name!r} has shape {y.shape}, expected ({len(t)},), one number for each time")
    return Curve(name, t, y)

