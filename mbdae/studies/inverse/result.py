"""Result of `mbdae.inverse_dynamics`: efforts, powers, and joint reactions."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...data_types import JsonObject
from ...errors import UnknownNameError
from ...mechanism import Mechanism, Reaction, reaction
from ...mechanism.tree.coordinate_units import coordinate_units, effort_unit
from ...solution.columns import LOCAL_AXES, row_names
from ...system import Array
from ...tabular import Columns, Tabular, rounded_zero
from ...units import displayed, quantity, time_span, unit_name
from ..kinematics.violations import Violation, violation_lines
from .peaks import delivered_and_absorbed, located_peak

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPEED_UNITS = {"N m": "rad/s", "N": "m/s"}  # units of speeds by the unit of the effort


class Demand(NamedTuple):
    """Requirements on an actuator, for choosing a motor.

    Attributes:
        name: name of the effort.
        unit: ``"N m"`` or ``"N"``.
        peak: largest |effort|.
        at: position of the peak on the figure's abscissa.
        rms: root of the mean square over time.
        speed: largest |speed|, in rad/s or m/s.
        power: largest delivered power, in W.
        braking: largest absorbed power, in W.
        energy: delivered minus absorbed energy in J.
        delivered: delivered energy in J.
        absorbed: absorbed energy in J.
    """

    name: str
    unit: str
    peak: float
    at: float
    rms: float
    speed: float
    power: float
    braking: float
    energy: float
    delivered: float
    absorbed: float


@dataclass(frozen=True)
class InverseDynamics(Tabular):
    """Efforts of actuators along a motion.

    Attributes:
        mechanism: the mechanism.
        t: times in s, (n,).
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        vdot: accelerations, (n, nv).
        names: names of the m efforts: those of actuators, with the component of a joint of several coordinates.
        units: units of the efforts, ``"N m"`` or ``"N"``.
        efforts: efforts, (n, m); nan in poses where the closures lose rank.
        speeds: speeds of the actuators in rad/s or m/s, (n, m).
        lam: multipliers of all rows except drivers', (n, c), of minimum norm for redundant rows; 0 for inactive rows.
        joints: force and torque in each tree joint, on its child body, in the joint's axes, (n, nj, 6).
        over: abscissa of figures, (n,).
        over_name: name of the abscissa with its unit.
        impacts: times of impacts of a run, whose impulses are not included in efforts.
        violations: unilateral constraints (stops, ropes, contacts, clutches) that a prescribed motion violates.
        static_friction: static friction in N m or N of joints at rest in a prescribed motion, not included in efforts.
        replaced: names of the torques, controllers and motors on actuated joints, which the efforts replace.
    """

    mechanism: Mechanism
    t: Array
    q: Array
    v: Array
    vdot: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    efforts: Array
    speeds: Array
    lam: Array
    joints: Array
    over: Array
    over_name: str
    impacts: tuple[float, ...] = ()
    violations: tuple[Violation, ...] = ()
    static_friction: dict[str, float] = field(default_factory=dict)
    replaced: tuple[str, ...] = ()

    @cached_property
    def power(self) -> Array:
        """Power delivered by each actuator in W, (n, m)."""
        return self.efforts * self.speeds

    @cached_property
    def undetermined(self) -> Array:
        """Times of poses in which the closures lose rank and efforts are undetermined, (k,)."""
        return self.t[~np.isfinite(self.efforts).all(axis=1)]

    @cached_property
    def demands(self) -> tuple[Demand, ...]:
        """Requirements on each actuator."""
        valid = np.isfinite(self.efforts).all(axis=1)
        t = self.t[valid]
        intervals = [k for k in np.split(np.arange(len(t)), 1 + np.flatnonzero(np.diff(t) == 0)) if len(k) > 1]
        out = []
        for i, (name, unit) in enumerate(zip(self.names, self.units, strict=True)):
            tau, speed, power = self.efforts[valid, i], self.speeds[valid, i], self.power[valid, i]
            length = float(t[-1] - t[0])
            rms = np.sqrt(_integral(tau, t, intervals, 2) / length) if length > 0 else np.abs(tau).max()
            delivered, absorbed = delivered_and_absorbed(power, t, intervals)
            peak, at = located_peak(tau, t, self.over[valid], intervals)
            out.append(
                Demand(
                    name, unit, peak, at, float(rms),
                    float(np.abs(speed).max()), float(max(power.max(), 0)), float(max(-power.min(), 0)),
                    _integral(power, t, intervals), delivered, absorbed,
                )
            )  # fmt: skip
        return tuple(out)

    def effort(self, name: str) -> Array:
        """Return the effort of an actuator in N m or N, (n,).

        Raises:
            UnknownNameError: lists the valid names.
        """
        if name not in self.names:
            raise UnknownNameError("actuator", name, self.names)
        return self.efforts[:, self.names.index(name)]

    def joint(self, name: str) -> tuple[Array, Array]:
        """Return force in N and torque in N m of a tree joint on its child body, in the joint's axes, (n, 3) each.

        Raises:
            UnknownNameError: lists the valid joints.
        """
        if name not in self.mechanism.joint_names:
            raise UnknownNameError("joint", name, self.mechanism.joint_names)
        values = self.joints[:, self.mechanism.joint_names.index(name)]
        return values[:, :3], values[:, 3:]

    def reaction(self, name: str) -> Reaction:
        """Return force and torque of a closure, see `mbdae.Solution.reaction`."""
        return reaction(self._without_drivers, name, self.t, self.q, self.lam)

    @cached_property
    def _without_drivers(self) -> Mechanism:
        m = self.mechanism
        return Mechanism(m.model, m.closures, m.forces, stops=m.stops, clutches=m.clutches)

    def signals(self) -> dict[str, Array]:
        """Return named columns of equal length: ``pandas.DataFrame(found.signals())`` is a table.

        ``t``; the abscissa under its name; ``effort``, ``speed`` and ``power.<actuator>``; ``lam.<closure>.<row>``;
        ``force`` and ``torque.<joint>`` on the child body, and of closures between frames on the second one: magnitude,
        and ``.1 .2 .3`` along the axes of the joint or of the first frame.
        """
        out: dict[str, Array] = {"t": self.t}
        if not self.over_name.startswith("t "):
            out["u"] = self.over
        for word, values in (("effort", self.efforts), ("speed", self.speeds), ("power", self.power)):
            out |= {f"{word}.{n}": x for n, x in zip(self.names, values.T, strict=True)}
        out |= dict(zip(row_names(self._without_drivers), self.lam.T, strict=True))
        wrenches = {name: self.joint(name) for name in self.mechanism.joint_names}
        reactions = [self.reaction(c.name) for c in self._without_drivers.closures if c.frames]
        for name, wrench in (wrenches | {r.name: (r.force, r.torque) for r in reactions}).items():
            for word, values in zip(("force", "torque"), wrench, strict=True):
                out[f"{word}.{name}"] = np.linalg.norm(values, axis=1)
                out |= {f"{word}.{name}.{axis}": x for axis, x in zip(LOCAL_AXES, values.T, strict=True)}
        return out

    def to_columns(self) -> Columns:
        """Return the columns of `signals` over time."""
        columns, known = self.signals(), dict(zip(self.names, self.units, strict=True))
        fixed = {"t": "s", "power": "W", "force": "N", "torque": "N m", "lam": "N, N m"}
        headers = {name: name.split(".", 1) for name in columns}
        found = {name: fixed.get(head[0], known.get(head[-1], "")) for name, head in headers.items()}
        speeds = {f"speed.{name}": SPEED_UNITS[unit] for name, unit in known.items()}
        return Columns(columns, {name: unit for name, unit in (found | speeds).items() if unit}, "t")

    def cells(self) -> list[list[str]]:
        """Return the requirements on each actuator."""
        power, energy = (unit_name(unit) for unit in "WJ")
        headers = ["actuator", "peak", "RMS", "unit", "speed", "unit", f"power {power}", f"braking {power}",
                 f"energy {energy}"]  # fmt: skip
        return [headers, *map(_cells, self.demands)]

    @property
    def abscissa(self) -> tuple[str, str]:
        """Name and unit in SI of `over`."""
        name, unit = self.over_name.rsplit(" (", 1)
        return name, unit.rstrip(")")

    def remarks(self) -> list[str]:
        """Return the largest joint forces, and where efforts are undetermined."""
        sizes = np.linalg.norm(self.joints[:, :, :3], axis=2)
        largest = np.nanmax(sizes, axis=0)
        largest, force = displayed(largest, "N")
        loads = ", ".join(f"{n} {x:.4g}" for n, x in zip(self.mechanism.joint_names, largest, strict=True))
        lines = [f"  largest forces in joints ({force}): {loads}"]
        if self.replaced:
            lines.append(f"  in place of {', '.join(map(repr, self.replaced))} on the actuated joints")
        if len(self.undetermined):
            times = ", ".join(f"{t:.6g}" for t in self.undetermined[:5])
            lines.append(f"  closures lose rank, and efforts are undetermined, at t = {times} s")
        if self.impacts:
            times = ", ".join(f"{t:.6g}" for t in self.impacts[:5]) + (", ..." if len(self.impacts) > 5 else "")
            lines.append(f"  impulses of impacts are not included in efforts: t = {times} s")
        lines += violation_lines(self.violations, *self.abscissa)
        lines += [f"  {name!r} is at rest: its static friction can balance up to {quantity(x, unit, '.4g')}"
                  for name, x, unit in self._friction()]  # fmt: skip
        return lines

    def _friction(self) -> list[tuple[str, float, str]]:
        units = coordinate_units(self.mechanism)
        return [(name, x, effort_unit(units, name)) for name, x in self.static_friction.items()]

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {
            "title": self.mechanism.title,
            "over": self.over_name,
            "actuators": [d._asdict() for d in self.demands],
            "undetermined": self.undetermined.tolist(),
            "impacts": list(self.impacts),
            "violations": [p._asdict() for p in self.violations],
            "static_friction": self.static_friction,
            "replaced": list(self.replaced),
            "table": {name: column.tolist() for name, column in self.signals().items()},
        }

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw efforts, power and joint forces; saved if a path is given.

        Raises:
            InputError: for a format other than .png, .svg, .pdf or .pgf, or an unwritable path.
        """
        from .. import figures
        from .figure import demands

        return figures.save_if_path(demands(self), path)

    def __str__(self) -> str:
        span = f"{len(self.t)} times from {time_span(self.t, 'g')}"
        lines = [f"inverse dynamics of {self.mechanism.title}, {span}"]
        for d in self.demands:
            name, unit = self.abscissa
            lines.append(
                f"  {d.name}: peak {quantity(d.peak, d.unit, '.5g')} at {name} = {quantity(d.at, unit, '.4g')}, "
                f"RMS {quantity(d.rms, d.unit, '.5g')}, up to {quantity(d.speed, SPEED_UNITS[d.unit], '.4g')}"
            )
            energy, low = rounded_zero(d.energy, d.delivered + d.absorbed), displayed(0.0 - d.braking, "W")[0]
            delivered, absorbed = (displayed(x, "J")[0] for x in (d.delivered, d.absorbed))
            lines.append(
                f"    power {low:.4g} to {quantity(d.power, 'W', '.4g')}; energy {quantity(energy, 'J', '.5g')}, "
                f"delivered {delivered:.5g}, absorbed {absorbed:.5g}"
            )
        return "\n".join([*lines, *self.remarks()])


def _cells(d: Demand) -> list[str]:
    """Return the cells of an actuator."""
    speed_unit = SPEED_UNITS[d.unit]
    values = ((d.peak, d.unit, ".5g"), (d.rms, d.unit, ".5g"), (d.speed, speed_unit, ".4g"), (d.power, "W", ".4g"),
              (d.braking, "W", ".4g"), (rounded_zero(d.energy, d.delivered + d.absorbed), "J", ".5g"))  # fmt: skip
    peak, rms, most, *rest = (f"{displayed(x, unit)[0]:{digits}}" for x, unit, digits in values)
    return [d.name, peak, rms, unit_name(d.unit), most, unit_name(speed_unit), *rest]


def _integral(values: Array, t: Array, intervals: list[Array], power: int = 1) -> float:
    """Integrate values**power over time (n,), between discontinuities, by monotone cubics.

    Source: F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984), for the cubics.
    """
    x, w = np.polynomial.legendre.leggauss(4)  # exact to degree 7
    out = 0.0
    for k in intervals:
        at = t[k][:-1, None] + np.diff(t[k])[:, None] * (x + 1) / 2
        out += float(np.diff(t[k]) @ (PchipInterpolator(t[k], values[k])(at) ** power @ w) / 2)
    return out
