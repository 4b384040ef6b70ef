"""Panels: the signals plotted next to a replay, grouped by unit and sampled for the screen."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import InputError, as_list, require
from ...solution.signals import find, signals, units
from ...system import Array
from ...tolerances import BELOW_ROUNDING
from ...units import displayed, unit_name
from ..figures import QUANTITY_NAMES

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...solution.solution import Solution

Signal = Callable[[float, Array, Array], float] | Sequence[float] | Array
Plot = str | Sequence[str]
POINTS = 1100  # points of a curve: from four per pixel on, uPlot draws it in steps
MAX_CURVES = 7  # largest number of distinguishable curves in a pane
AT_STEPS = ("energy", "work", "g", "Gv")  # signals that are drawn at nodes, without interpolation
AXIS_TITLES = {**QUANTITY_NAMES, "m, rad": "|g|", "m/s, rad/s": "|G v|"}


class Curve(NamedTuple):
    """A signal over time: t and y (n,); ``ghost`` is the index of another solution, -1 for the main one."""

    name: str
    t: Array
    y: Array
    ghost: int = -1


@dataclass(frozen=True)
class PlotPanel:
    """Curves over one pair of axes.

    Attributes:
        title: the quantity, with its unit.
        curves: curves of the solution and of its ghosts.
        logarithmic: whether the ordinate is logarithmic.
        cut: lower limit of a logarithmic ordinate, at rounding; 0 for the smallest value.
        unit: SI unit of the curves, as in the title.
    """

    title: str
    curves: tuple[Curve, ...]
    logarithmic: bool = False
    cut: float = 0.0
    unit: str = ""


def panes(
    sol: "Solution",
    plots: str | Sequence[Plot] | None,
    user_signals: Mapping[str, Signal],
    ghosts: Iterable["Solution"] = (),
) -> list[PlotPanel]:
    """Return the panes of a solution, one for each entry and unit.

    Args:
        sol: the solution.
        plots: entries, each a name of `Solution.signals`, a prefix of several (``"q"``, ``"lam.pin"``), or a list of
            both; joint coordinates, energies and |g| when left out.
        user_signals: functions of (t, q, v), or arrays over ``sol.t``, by name. Signals that are not in ``plots`` have
            additional panes.
        ghosts: further solutions, for the same curves.

    Raises:
        UnknownNameError: for a name that does not exist.
        InputError: for a user signal of another length, or with the name of a column.
    """
    if plots is not None and not plots and not user_signals:
        return []
    mech = sol.mechanism
    chosen = [_expanded(entry, user_signals, mech) for entry in _entries(plots)]
    required = [*_columns(chosen, user_signals, mech), *(() if plots else ("kinetic", "potential"))]
    table = _table(sol, user_signals, required)
    groups = _defaults(table, sol) if plots is None else [_Group(tuple(dict.fromkeys(names))) for names in chosen]
    groups += _ungrouped(groups, user_signals)
    functions = {name: signal for name, signal in user_signals.items() if callable(signal)}
    tables = [table, *(_table(ghost, functions, required) for ghost in ghosts)]
    found = [pane for group in groups for pane in _by_unit(group, tables, mech)]
    return [_in_display_units(_readable(pane) if plots is None else pane) for pane in found]


class _Group(NamedTuple):
    names: tuple[str, ...]
    note: str = ""


def _entries(plots: str | Sequence[Plot] | None) -> list[tuple[str, ...]]:
    message = "plots is a list of signals, or of lists of them"
    entries = [plots] if isinstance(plots, str) else plots or ()
    require(entries, Iterable, message)
    return [tuple(as_list(entry, message)) for entry in entries]


def _expanded(entry: Sequence[str], user_signals: Mapping[str, Signal], mech: "Mechanism") -> list[str]:
    """Return the signals of an entry, whose names may be prefixes of several."""
    return [signal for name in entry for signal in ([name] if name in user_signals else find(mech, name))]


def _columns(chosen: Sequence[Sequence[str]], user_signals: Mapping[str, Signal], mech: "Mechanism") -> list[str]:
    """Return the chosen columns of the solution, and all coordinates."""
    coordinates = [name for name in units(mech) if name.startswith("q.")]
    return [*(name for entry in chosen for name in entry if name not in user_signals), *coordinates]


def _ungrouped(groups: Sequence[_Group], user_signals: Mapping[str, Signal]) -> list[_Group]:
    """Return a group for each user signal that is in no other group."""
    grouped = {name for group in groups for name in group.names}
    return [_Group((name,)) for name in user_signals if name not in grouped]


def is_over_arclength(sol: "Solution") -> bool:
    """Return whether t is the arclength of a curve of poses, in which energies of motion have no meaning."""
    return sol.settings.get("over") == "arclength"


def _defaults(table: Mapping[str, Curve], sol: "Solution") -> list[_Group]:
    """Return the default groups: coordinates by unit except for quaternions, energies, and the largest |g|."""
    mech, energies = sol.mechanism, ("potential",) if is_over_arclength(sol) else ("kinetic", "potential", "energy")
    unit = {n: u for n, u in units(mech).items() if n.startswith("q.") and u != "1"}  # quaternions are not readable
    by_unit = [_largest_range(table, [n for n in unit if unit[n] == u]) for u in dict.fromkeys(unit.values())]
    return [*by_unit, _Group(energies), *([_Group(("g",))] if mech.ng else [])]


def _largest_range(table: Mapping[str, Curve], names: list[str]) -> _Group:
    """Return at most `MAX_CURVES` names, those with the largest ranges of values."""
    if len(names) <= MAX_CURVES:
        return _Group(tuple(names))
    spread = {name: float(np.ptp(table[name].y)) for name in names}
    best = sorted(names, key=lambda name: -spread[name])[:MAX_CURVES]
    return _Group(tuple(n for n in names if n in best), f", {MAX_CURVES} of {len(names)} with the largest ranges")


def _by_unit(group: _Group, tables: Sequence[Mapping[str, Curve]], mech: "Mechanism") -> list[PlotPanel]:
    known = units(mech)
    unit = {name: known.get(name, name) for name in group.names}  # each user signal has a separate pane
    out = []
    for kind in dict.fromkeys(unit.values()):
        names = [name for name in group.names if unit[name] == kind]
        curves = [t[n]._replace(ghost=k - 1) for k, t in enumerate(tables) for n in names if n in t]
        word = names[0] if len(names) == 1 and names[0] not in ("g", "Gv") else AXIS_TITLES.get(kind, kind)
        title = f"{word} ({kind}){group.note}" if kind not in ("", "1", word) else word + group.note
        drift = set(names) <= {"g", "Gv"}
        out.append(PlotPanel(title, _without_common_prefix(curves), drift, BELOW_ROUNDING if drift else 0.0, kind))
    return out


def _without_common_prefix(curves: Sequence[Curve]) -> tuple[Curve, ...]:
    """Return curves without a common prefix of their names, which is in the title."""
    headers = {c.name.partition(".")[0] for c in curves}
    common = len(headers) == 1 and all("." in c.name for c in curves)
    return tuple(c._replace(name=c.name.partition(".")[2]) if common else c for c in curves)


def _in_display_units(pane: PlotPanel) -> PlotPanel:
    """Return a pane in display units; units of user signals are not known."""
    title = pane.title.replace(f"({pane.unit})", f"({unit_name(pane.unit)})")
    if title == pane.title:
        return pane
    curves = tuple(c._replace(y=displayed(c.y, pane.unit)[0]) for c in pane.curves)
    return replace(pane, title=title, curves=curves)


def _readable(pane: PlotPanel) -> PlotPanel:
    """Return a pane with angles wrapped to -pi and pi, and potential energy relative to its start."""
    if pane.title.startswith("energies"):
        zero = next((c.y[0] for c in pane.curves if c.name == "potential" and c.ghost < 0), 0.0)
        shifted = tuple(c if c.name == "kinetic" else c._replace(y=c.y - zero) for c in pane.curves)
        return replace(pane, title="energies (J), potential from its start", curves=shifted)
    if "(rad)" not in pane.title or not any(np.ptp(c.y) > 2 * np.pi for c in pane.curves):
        return pane
    angular = {c.name for c in pane.curves if np.ptp(c.y) > 2 * np.pi}
    half = "π" if unit_name("rad") == "rad" else f"{displayed(np.pi, 'rad')[0]:g}"
    wrapped = tuple(_wrapped(c) if c.name in angular else c for c in pane.curves)
    return replace(pane, title=pane.title.replace("(rad)", f"(rad), within {half}"), curves=wrapped)


def _wrapped(curve: Curve) -> Curve:
    """Return an angle in [-pi, pi), with gaps at its jumps."""
    y = (curve.y + np.pi) % (2 * np.pi) - np.pi
    jumps = np.flatnonzero(np.abs(np.diff(y)) > np.pi) + 1
    distance = np.abs(curve.t[:, None] - (curve.t[jumps - 1] + curve.t[jumps]) / 2).min(axis=1, initial=np.inf)
    return curve._replace(y=np.where(distance < np.ptp(curve.t) / 400, np.nan, y))


def _table(sol: "Solution", user_signals: Mapping[str, Signal], required: Sequence[str]) -> dict[str, Curve]:
    """Return the requested curves of a solution by name: smooth ones at uniform times, `AT_STEPS` at nodes."""
    sample = np.unique(np.linspace(0, len(sol.t) - 1, min(len(sol.t), POINTS)).astype(int))
    steps = replace(sol, t=sol.t[sample], y=sol.y[sample], z_own=sol.z_own[sample], steps=sol.nodes)
    smooth = sol.resampled(np.linspace(sol.t[0], sol.t[-1], POINTS)) if len(sol.t) > 1 else steps
    table = {name: Curve(name, smooth.t, values) for name, values in signals(smooth, required).items()}
    table |= {name: Curve(name, steps.t, values) for name, values in signals(steps, AT_STEPS).items()}
    for name, signal in user_signals.items():
        if name in units(sol.mechanism):
            raise InputError(f"a signal needs another name, {name!r} is a column of the solution")
        table[name] = _user_curve(name, signal, sol, smooth)
    return table


def _user_curve(name: str, signal: Any, sol: "Solution", smooth: "Solution") -> Curve:
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
