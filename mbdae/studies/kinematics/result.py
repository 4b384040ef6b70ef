"""Result of `mbdae.kinematics`: poses along a curve, with their rates per unit of the input."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, UnknownNameError, as_list, is_count, is_number
from ...mechanism import Mechanism
from ...mechanism.tree.coordinate_units import coordinate_units
from ...mechanism.tree.frames import WORLD, frame_motions, frame_names
from ...solution.columns import coordinates
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular, align_columns, rounded_zero
from ...tolerances import SOLUTION_ROUNDING
from ...units import displayed, unit_name
from .curve.branch_following import TracedCurve
from .curve.pose_curve import BranchPoint
from .curve.toggles import Toggle, toggle_table, toggles
from .violations import Violation, violation_lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDS = {
    "range": "to the end of the range",
    "closed": "back to its first pose",
    "failed": "to a pose beyond which it cannot be continued",
    "limit": "to the limit of steps or displacements",
    "branch": "to an earlier curve",
}


class CurveSegment(NamedTuple):
    """A curve: indices of its first and after its last pose, the range of its input, and how it ends."""

    first: int
    last: int
    low: float
    high: float
    ended: str


@dataclass(frozen=True)
class Kinematics(Tabular):
    """Poses of a mechanism with one degree of freedom along a curve, or several.

    Attributes:
        mechanism: the mechanism.
        drive: name of the input u.
        locked: names of the locked joints.
        output: joint of the transmission angle; empty for none.
        unit: unit of the input, ``"rad"`` or ``"m"``.
        u: input, (n,).
        s: arclength along each curve in rad and characteristic lengths, (n,), see `Mechanism.characteristic_length`.
        q: configurations, (n, nq).
        tangent: tangents dq/ds, (n, nv), in rad and m, also finite at dead points.
        curvature: d2q/ds2, (n, nv); nan at branch points.
        speed: du/ds, (n,): zero at dead points.
        input_curvature: d2u/ds2 = gamma_in + e_in . curvature, (n,).
        transmission: angle at the output in rad, 0 to pi/2, (n,).
        dead_points: input and configuration where the drive reverses.
        branch_points: poses in which several branches intersect.
        segments: segments of the curves in order; one without ``branches``.
        hidden: inputs close to which more than two branches intersect, and the curve continues straight.
        violations: violations of stops, ropes, contacts and clutches, which exert no forces, over the input.
        traced: the curves between the poses.
        listed: whether the text lists toggle positions.
    """

    mechanism: Mechanism
    drive: str
    locked: tuple[str, ...]
    output: str
    unit: str
    u: Array
    s: Array
    q: Array
    tangent: Array
    curvature: Array
    speed: Array
    input_curvature: Array
    transmission: Array
    dead_points: tuple[tuple[float, Array], ...]
    branch_points: tuple[BranchPoint, ...]
    segments: tuple[CurveSegment, ...]
    hidden: tuple[float, ...] = ()
    violations: tuple[Violation, ...] = ()
    traced: tuple[TracedCurve, ...] = field(default=(), repr=False, compare=False)
    listed: bool = False

    @cached_property
    def moving(self) -> Array:
        """Mask of the poses that are not dead points, (n,)."""
        return np.abs(self.speed) > SOLUTION_ROUNDING

    @cached_property
    def rates(self) -> Array:
        """Velocities per unit speed of the drive, dq/du, (n, nv); nan at dead points, where they are infinite."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.moving[:, None], self.tangent / self.speed[:, None], np.nan)

    @cached_property
    def accelerations(self) -> Array:
        """Accelerations at constant unit speed of the drive, d2q/du2, (n, nv); nan at dead points and branch points."""
        with np.errstate(divide="ignore", invalid="ignore"):
            along = self.curvature - (self.input_curvature / self.speed)[:, None] * self.tangent
            return np.where(self.moving[:, None], along / (self.speed**2)[:, None], np.nan)

    def ratio(self, joint: str) -> Array:
        """Return the velocity ratio of a joint of one coordinate to the drive, (n,); nan at dead points."""
        if f"v.{joint}" not in self.velocity_names:
            raise UnknownNameError("joint", joint, [n[2:] for n in self.velocity_names])
        return self.rates[:, self.velocity_names.index(f"v.{joint}")]

    @cached_property
    def advantage(self) -> Array:
        """Mechanical advantage at the output joint: its effort per unit effort of the drive, without losses, (n,).

        It is the inverse of the velocity ratio, infinite where the output reverses, 0 at dead points of the input; nan
        without an output.
        """
        if not self.output:
            return np.full(len(self.u), np.nan)
        along, speed = self.tangent[:, self.velocity_names.index(f"v.{self.output}")], self.speed * self.moving
        return np.divide(speed, along, out=np.full_like(speed, np.inf), where=np.abs(along) > SOLUTION_ROUNDING)

    @cached_property
    def toggles(self) -> tuple[Toggle, ...]:
        """Toggle positions: poses in which the drive or another joint of one coordinate reverses, located exactly."""
        return tuple(t for x in self.traced for t in toggles(x, self.mechanism, self.drive))

    def toggle_table(self) -> list[list[str]]:
        """Return the toggle positions as text, headings first, with reversing joints, the input and all coordinates."""
        found, ends = self.toggles, (CurveSegment(0, len(self.toggles), 0.0, 0.0, "range"),)
        q, v = (np.array([getattr(t, name) for t in found]) for name in "qv")
        poses = replace(self, q=q, tangent=v, curvature=0 * v, s=np.arange(len(q)) * 1.0, segments=ends)
        columns = coordinates(poses.run()) if found else {}
        values = {n: x for n, x in columns.items() if n.startswith("q.")}
        return toggle_table(found, values, self.drive, self.unit, coordinate_units(self.mechanism))

    @cached_property
    def velocity_names(self) -> list[str]:
        """Names ``v.<joint>`` of the columns of rates."""
        return [name for name in coordinate_units(self.mechanism) if name.startswith("v.")]

    def frames(self, names: str | list[str] | None = None) -> tuple[Array, Array, Array]:
        """Return positions, and velocities and accelerations at unit speed, of the origins of frames, (k, n, 3) each.

        Raises:
            UnknownNameError: for a frame that does not exist.
        """
        chosen = self.frame_names if names is None else as_list(names, "names is a list of frames")
        return frame_motions(self.mechanism.model, chosen, self.q, self.rates, self.accelerations)

    @cached_property
    def frame_names(self) -> list[str]:
        """Names of all frames except the world."""
        return [name for name in frame_names(self.mechanism.model) if name != WORLD]

    def run(self, segment: int = 0, *, speed: float | None = None) -> Solution:
        """Return one of the curves as a motion in time, for a replay or `mbdae.inverse_dynamics`.

        Args:
            segment: index of one of `segments`.
            speed: constant speed of the drive in rad/s or m/s, from the first pose, or back to it; when left out, the
                arclength increases by one per second, also through dead points.

        Raises:
            InputError: for an unknown segment, zero speed, or dead points, where the speed cannot be constant.
        """
        if not (is_count(segment, 0) and segment < len(self.segments)):
            raise InputError(f"segment must be a whole number from 0 to {len(self.segments) - 1}, got {segment!r}")
        part = slice(self.segments[segment].first, self.segments[segment].last)
        q, v, a, t = self.q[part], self.tangent[part], self.curvature[part], self.s[part]
        if speed is not None:
            if not is_number(speed) or speed == 0:
                raise InputError(f"speed must be a number other than zero, got {speed!r}")
            t = (self.u[part] - self.u[part.start]) / speed
            if not (self.moving[part].all() and (np.diff(t) > 0).all() | (np.diff(t) < 0).all()):
                raise InputError(f"{self.drive!r} reverses at dead points, where its speed cannot be constant")
            v, a = speed * self.rates[part], speed**2 * self.accelerations[part]
            if t[-1] < t[0]:
                q, v, a, t = q[::-1], v[::-1], a[::-1], t[::-1]
        mech, n = self.mechanism, len(t)
        rest = np.zeros((n, len(mech.states) + 1))
        settings = {"method": "kinematics", "dense_order": 3, "formulation": "index2", "project": False}
        settings |= {"over": "arclength"} if speed is None else {}
        counts = dict.fromkeys(("f", "M", "G", "solves", "factorizations"), 0)
        stats = {"steps": n - 1, "rejected": 0, **counts, "seconds": 0.0, "backend": "python"}
        sol = Solution(mech, t, np.hstack([q, v, rest]), np.full((n, mech.ng), np.nan), "finished",
                       f"a curve of poses over {self.drive}", stats, settings)  # fmt: skip
        sol.rates |= dict(enumerate(np.hstack([v, np.nan_to_num(a), rest])))
        return sol

    def signals(self) -> dict[str, Array]:
        """Return named columns of equal length: ``pandas.DataFrame(found.signals())`` is a table.

        ``curve`` counts from 1; ``u`` and ``s``, the input and the arclength; ``q.<joint>``, ``v.<joint>`` and
        ``a.<joint>`` as in `Solution.signals`, velocities and accelerations at unit speed of the drive;
        ``transmission`` in rad, the mechanical ``advantage``; ``position.<frame>.x``, ``velocity``, ``acceleration``.
        """
        curve = np.concatenate([np.full(x.last - x.first, i + 1) for i, x in enumerate(self.segments)])
        out: dict[str, Array] = {"curve": curve, "u": self.u, "s": self.s}
        parts = [coordinates(self.run(i)) for i in range(len(self.segments))]
        out |= {k: np.concatenate([p[k] for p in parts]) for k in parts[0] if k.startswith("q.")}
        out |= dict(zip(self.velocity_names, self.rates.T, strict=True))
        out |= {f"a.{k[2:]}": x for k, x in zip(self.velocity_names, self.accelerations.T, strict=True)}
        if self.output:
            out["transmission"], out["advantage"] = self.transmission, self.advantage
        for word, values in zip(("position", "velocity", "acceleration"), self.frames(), strict=True):
            for name, path in zip(self.frame_names, values.reshape(-1, len(self.u), 3), strict=True):
                out |= {f"{word}.{name}.{axis}": path[:, k] for k, axis in enumerate("xyz")}
        return out

    def to_columns(self) -> Columns:
        """Return the columns of `signals` over the input; rates and accelerations are per unit of it."""
        columns, known, per = self.signals(), coordinate_units(self.mechanism), self.unit
        rates = {f"a.{n[2:]}": f"{u}/{per}^2" for n, u in known.items() if n.startswith("q.")}
        rates |= {f"v.{n[2:]}": f"{u}/{per}" for n, u in known.items() if n.startswith("q.")}
        headers = {"u": per, "transmission": "rad", "advantage": self._advantage_unit, "position": "m"}
        headers |= {"velocity": f"m/{per}", "acceleration": f"m/{per}^2"}
        found = {name: (known | rates).get(name, headers.get(name.partition(".")[0], "")) for name in columns}
        return Columns(columns, {name: unit for name, unit in found.items() if unit}, "u")

    @property
    def _advantage_unit(self) -> str:
        out = coordinate_units(self.mechanism)[f"q.{self.output}"] if self.output else self.unit
        return "1" if out == self.unit else f"{self.unit}/{out}"

    def _input(self, u: float) -> float:
        """Return an input in display units, 0 if it is rounding."""
        return float(displayed(rounded_zero(u), self.unit)[0])

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {
            "title": self.mechanism.title,
            "drive": self.drive,
            "locked": list(self.locked),
            "output": self.output,
            "unit": self.unit,
            "curves": [x._asdict() for x in self.segments],
            "dead_points": [{"u": u, "q": q.tolist()} for u, q in self.dead_points],
            "branch_points": [b.to_dict() for b in self.branch_points],
            "crossings_not_followed": list(self.hidden),
            "violations": [p._asdict() for p in self.violations],
            "toggles": [{"u": t.u, "q": t.q.tolist(), "reversing": list(t.reversing)} for t in self.toggles],
            "table": {name: column.tolist() for name, column in self.signals().items()},
        }

    @property
    def monotonic_segments(self) -> list[slice]:
        """Slices of poses between dead points, over which the input is monotonic."""
        out = []
        for x in self.segments:
            inner = (x.first + 1 + np.flatnonzero(~self.moving[x.first + 1 : x.last - 1])).tolist()
            out += [slice(a, b + 1) for a, b in pairwise([x.first, *inner, x.last - 1])]
        return out

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw coordinates, rates and the transmission angle against the input; saved if a path is given.

        Raises:
            InputError: for a format other than .png, .svg, .pdf or .pgf, or an unwritable path.
        """
        from .. import figures
        from .figure import curves

        return figures.save_if_path(curves(self), path)

    def summary(self) -> JsonObject:
        """Return `to_dict` without the table."""
        return {key: value for key, value in self.to_dict().items() if key != "table"}

    def __str__(self) -> str:
        unit = unit_name(self.unit)
        lines = [f"kinematics of {self.mechanism.title} over {self.drive} ({unit})"]
        if self.locked:
            lines.append(f"  locked: {', '.join(self.locked)}")
        for i, x in enumerate(self.segments, 1):
            low, high = (self._input(u) for u in (x.low, x.high))
            lines.append(f"  curve {i}: {x.last - x.first} poses, input {low:.6g} to {high:.6g}, {ENDS[x.ended]}")
        if self.dead_points:
            lines.append(f"  dead points at {', '.join(f'{self._input(u):.12g}' for u, _ in self.dead_points)}")
        for b in self.branch_points:
            at = round(self._input(b.u), 12) + 0.0
            lines.append(f"  branch point at {at:.12g}: {2 * len(b.directions)} branch directions")
        hidden = (round(self._input(u), 6) + 0.0 for u in self.hidden)
        lines += [f"  more than two branches intersect near {u:.6g}: the curve continues straight" for u in hidden]
        lines += violation_lines(self.violations, self.drive, self.unit)
        if self.output and np.isfinite(self.transmission).any():
            low, high = (np.degrees(f(self.transmission)).round(6) for f in (np.nanmin, np.nanmax))
            lines.append(f"  transmission angle at {self.output}: {low:.4g} to {high:.4g} degrees")
        return "\n".join([*lines, *(f"  {x}" for x in (align_columns(self.toggle_table()) if self.listed else []))])
