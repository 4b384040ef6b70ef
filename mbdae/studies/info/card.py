"""Model card: components of a mechanism, its degrees of freedom, and unsupported features."""

import re
import textwrap
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ...data_types import JsonObject
from ...integrate.options.options import complete_settings
from ...mechanism import Mechanism, redundant
from ...mechanism.closures.constraints import spec_kind
from ...mechanism.equilibrium.elastic_modes import elastic_modes
from ...mechanism.signals.reactions import mass_scaled_jacobian, rank
from ...mechanism.tree.coordinate_units import coordinate_units
from ...mechanism.tree.frames import find_joint, fixed_links
from ...mechanism.tree.joints import file_kind
from ...mechanism.tree.tree_terms import flexible_bodies
from ...system import Array
from ...tabular import Tabular
from ...tolerances import AGREEMENT, SOLUTION_ROUNDING
from ...units import displayed, quantity, unit_name
from .impossible_inertias import impossible_inertias
from .inertia_source import inertia_source
from .start_values import by_joint

NOT_MODELLED = (
    "contact of shapes",
    "joint limits (except stops)",
    "effort and velocity limits",
    "dry joint friction (except joint_friction forces)",
)
IMPOSSIBLE = "no rigid body has it, as one principal moment exceeds the sum of the others"


@dataclass(frozen=True)
class Card(Tabular):
    """Result of `mbdae.info` for a mechanism.

    Attributes:
        title: title of the mechanism.
        nq: length of a configuration.
        nv: length of a velocity.
        ng: rows of all closures.
        switched: number of rows that are active in some modes only.
        rank: number of independent rows at the start, without switched ones.
        dof: degrees of freedom, nv - rank.
        position_dof: nv - rank of the rows with a position level: larger if there are nonholonomic rows.
        joints: name and kind of each joint, in the order of q.
        closures: name, kind, frames or joints, and rows of each closure and driver, and the number of its redundant
            rows.
        forces: names of the forces.
        gravity: acceleration of gravity in m/s^2.
        q: start configuration (nq,).
        v: start velocity (nv,).
        positions: start coordinates by joint, in m and rad; the angle of a joint with (cos, sin).
        velocities: start velocities by joint; of free and spherical joints in the axes of the body.
        g_loaded: max |g| of the file's start values, before assembly.
        g: max |g| at the assembled start.
        Gv: max |G v| at the assembled start.
        violation: closure that the file's start values violate, and its violation, in words.
        motors: names of the motors, the inputs of controllers.
        parameters: name and value of each parameter of the model, and its valid values, in words.
        solve: settings of runs in the file.
        not_modelled: features of the file that the model ignores.
        fixed: links without a parent joint: their base is fixed to the world.
        inertia: the source of M, nle and J in runs, see `inertia_source`.
        impossible: joints of bodies with physically impossible inertias, see `impossible_inertias`.
        flexible: frequencies of the modes of each flexible body in rad/s, with its frame at rest.
        vibrations: frequencies of the flexible bodies in rad/s at the start, with the closures, and damping ratios.
        units: units of positions and velocities by joint, ``q.crank``.
    """

    title: str
    nq: int
    nv: int
    ng: int
    switched: int
    rank: int
    dof: int
    position_dof: int
    joints: tuple[tuple[str, str], ...]
    closures: tuple[dict[str, Any], ...]
    forces: tuple[str, ...]
    gravity: tuple[float, ...]
    q: tuple[float, ...]
    v: tuple[float, ...]
    positions: dict[str, float]
    velocities: dict[str, float]
    g_loaded: float
    g: float
    Gv: float
    violation: str = ""
    motors: tuple[str, ...] = ()
    parameters: tuple[dict[str, Any], ...] = ()
    solve: dict[str, Any] = field(default_factory=dict)
    not_modelled: tuple[str, ...] = NOT_MODELLED
    fixed: tuple[str, ...] = ()
    inertia: str = ""
    impossible: tuple[str, ...] = ()
    flexible: dict[str, list[float]] = field(default_factory=dict)
    vibrations: tuple[tuple[float, float], ...] = ()
    units: dict[str, str] = field(default_factory=dict)

    def facts(self) -> dict[str, str]:
        """Return the facts by heading, lists on several lines."""
        closures = [
            f"{x['name']}: {x['kind']} {' - '.join(x['joins'])}, {x['rows']} rows"
            + (f" ({x['dependent']} depend on others)" if x["dependent"] else "")
            for x in self.closures
        ]
        sizes = f"nq = {self.nq}, nv = {self.nv}, {self.ng} closure rows of rank {self.rank}"
        sizes += f", {self.switched} switched" if self.switched else ""
        return {
            "sizes": f"{sizes}; degrees of freedom: {self.dof}",
            "joints": ", ".join(f"{name} ({kind})" for name, kind in self.joints),
            **({"fixed base": ", ".join(self.fixed)} if self.fixed else {}),
            "closures": "\n".join(closures) or "none",
            "forces": ", ".join(self.forces) or "none",
            **({"inertia": f"{', '.join(self.impossible)}: {IMPOSSIBLE}"} if self.impossible else {}),
            "gravity": self._gravity(),
            "start": "\n".join([f"|g| = {self.g:.1e}, |G v| = {self.Gv:.1e}", *self._start()]),
            "not modelled": ", ".join(self.not_modelled),
        }

    def cells(self) -> list[list[str]]:
        """Return the facts as a table of two columns."""
        return [["", self.title], *([name, text.replace("\n", "; ")] for name, text in self.facts().items())]

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return asdict(self)

    def __str__(self) -> str:
        lines = [self.title, self._sizes(), "  joints    " + ", ".join(f"{n} ({k})" for n, k in self.joints)]
        if self.fixed:
            lines.append(f"  fixed base {', '.join(self.fixed)}")
        lines += self._closures()
        lines += self._flexible()
        lines += [f"  forces    {', '.join(self.forces) or 'none'}; gravity {self._gravity()}"]
        lines += [f"  parameter {p['name']} = {p['value']}: {p['takes']}" for p in self.parameters]
        if self.inertia:
            lines.append(f"  inertia   by {self.inertia}")
        if self.impossible:
            lines.append(wrapped(f"  inertia   of {', '.join(self.impossible)}: {IMPOSSIBLE}"))
        if self.solve:
            lines.append(f"  solve     {', '.join(f'{name} = {x}' for name, x in self.solve.items())}")
        if self.motors:
            lines.append(f"  motors    {', '.join(self.motors)}")
        as_loaded = f"{self.g_loaded:.1e} as loaded{self.violation}"
        lines.append(f"  start     |g| {self.g:.1e} ({as_loaded}), |G v| {self.Gv:.1e}")
        lines += [wrapped(f"            {line}") for line in self._start()]
        lines += [wrapped(f"  not modelled: {', '.join(self.not_modelled)}")]
        return "\n".join(lines)

    def _gravity(self) -> str:
        return f"[{', '.join(quantity(x, 'm/s^2').partition(' ')[0] for x in self.gravity)}] {unit_name('m/s^2')}"

    def _start(self) -> list[str]:
        """Return lines of the start coordinates, and of the velocities that are not zero."""
        tables = {"q": self.positions, "v": {name: x for name, x in self.velocities.items() if readable(x) != "0"}}
        lines = [f"{kind}: " + ", ".join(f"{n} = {self._value(f'{kind}.{n}', x)}" for n, x in table.items())
                 for kind, table in tables.items() if table]  # fmt: skip
        return lines if tables["v"] else [*lines, "at rest"]

    def _value(self, name: str, x: float) -> str:
        """Return a coordinate or velocity as text; angles of joints of several coordinates are in rad, too."""
        unit = self.units.get(name, "rad" if name.endswith(".angle") else "")
        value, unit = displayed(x, unit)
        return readable(value) if unit in ("", "1") else f"{readable(value)} {unit}"

    @property
    def _dependent(self) -> int:
        """Number of rows that depend on others."""
        return self.ng - self.switched - self.rank

    def _sizes(self) -> str:
        counts = [f"rank {self.rank}", f"{self._dependent} rows depend on others" if self._dependent else ""]
        counts.append(f"{self.switched} switched" if self.switched else "")
        rows = f"closure rows {self.ng} ({', '.join(filter(None, counts))})"
        line = f"  nq {self.nq}, nv {self.nv}, {rows}, degrees of freedom {self.dof}"
        return line + (f", {self.position_dof} of positions" if self.position_dof != self.dof else "")

    def _flexible(self) -> list[str]:
        """Return lines of the frequencies of flexible bodies, alone and in the mechanism."""
        lines = [f"  flexible  {name}: {_rounded(w)}, its frame at rest" for name, w in self.flexible.items()]
        if self.vibrations:
            ratios = {ratio for _, ratio in self.vibrations}
            damping = f", damping {min(ratios):.2g} to {max(ratios):.2g}" if max(ratios) else ", no damping"
            lines.append(f"            with the closures {_rounded(w for w, _ in self.vibrations)}{damping}")
        return lines

    def _closures(self) -> list[str]:
        """Return a line for each closure, and one for reactions that are not unique."""
        lines = []
        for c in self.closures:
            dependent = f", {c['dependent']} dependent" if c["dependent"] else ""
            lines.append(f"  closure   {c['name']}: {c['kind']} {' - '.join(c['joins'])}, {c['rows']} rows{dependent}")
        if self._dependent:
            names = ", ".join(c["name"] for c in self.closures if c["dependent"])
            lines.append(f"            reactions of {names} are not unique: lam has minimum norm")
        return lines


def _rounded(frequencies: Iterable[float]) -> str:
    """Return frequencies in rad/s as text, with their unit."""
    shown = ", ".join(f"{displayed(w, 'rad/s')[0]:.6g}" for w in frequencies)
    return f"{shown} {unit_name('rad/s')}"


def wrapped(line: str) -> str:
    """Wrap a line after commas to about 100 characters, with indented continuation lines."""
    text = line.lstrip()
    unbroken = re.sub("(?<!,) ", "\N{NO-BREAK SPACE}", text)
    wrapper = textwrap.TextWrapper(100, break_long_words=False, break_on_hyphens=False, subsequent_indent=" " * 14)
    wrapper.initial_indent = " " * (len(line) - len(text))
    return wrapper.fill(unbroken).replace("\N{NO-BREAK SPACE}", " ")


def readable(x: float) -> str:
    """Return a number with six digits, or 0 if it is rounding."""
    return f"{x:.6g}" if abs(x) > SOLUTION_ROUNDING else "0"


def card(mech: Mechanism) -> Card:
    """Describe a mechanism at its start state.

    Args:
        mech: the mechanism.

    Returns:
        Sizes, rank r of G and degrees of freedom nv - r, joints, closures, forces, and unsupported features.

    Raises:
        AssemblyError: if the start cannot be assembled.
        UnknownNameError: for an unknown method in its file.
    """
    complete_settings(mech, {})
    q, v = mech.start
    system = mech.system()
    system.derivative(0.0, mech.point())
    rows = system.rows if system.rows is not None else np.empty(0, int)
    dependent = redundant(mech, 0.0, q)
    positions = rank(mass_scaled_jacobian(system, 0.0, q)[mech.positional])
    by_name, speeds = by_joint(system, 0.0, mech.point())
    g, Gv = mech.residual(q, v)
    loaded, worst = mech.unassembled_start[0], mech.start_violation
    closures = (
        {
            "name": c.name,
            "kind": spec_kind(c),
            "joins": list(c.between),
            "rows": c.m,
            "dependent": dependent.get(c.name, 0),
        }
        for c in mech.constraints
    )
    return Card(
        title=mech.title,
        nq=mech.nq,
        nv=mech.nv,
        ng=mech.ng,
        switched=len({row for switch in mech.switches for row in switch.rows}),
        rank=len(rows),
        dof=mech.nv - len(rows),
        position_dof=mech.nv - (positions if not mech.positional.all() else len(rows)),
        joints=tuple((n, file_kind(find_joint(mech.model, n))) for n in mech.joint_names),
        closures=tuple(closures),
        forces=tuple(system.laws.names),
        gravity=tuple(mech.gravity.tolist()),
        q=tuple(q.tolist()),
        v=tuple(v.tolist()),
        positions=by_name,
        velocities=speeds,
        g_loaded=float(np.abs(mech.residual(loaded, v)[0]).max(initial=0)),
        g=float(np.abs(g).max(initial=0)),
        Gv=float(np.abs(Gv).max(initial=0)),
        violation=f", {worst.name!r} violated by {worst.text}" if worst and worst.size > AGREEMENT else "",
        motors=tuple(m.name for m in mech.motors),
        parameters=tuple((mech.source or {}).get("parameters", ())),
        solve=mech.settings.given,
        not_modelled=(*NOT_MODELLED, *mech.left_out),
        fixed=tuple(fixed_links(mech.model)),
        impossible=impossible_inertias(mech),
        inertia=inertia_source(mech),
        units=coordinate_units(mech),
        **_elastic(mech, q),
    )


def _elastic(mech: Mechanism, q: Array) -> dict[str, Any]:
    """Return the frequencies of flexible bodies, alone and in the mechanism."""
    if not (bodies := flexible_bodies(mech.model)):
        return {}
    found = elastic_modes(mech.system(), 0.0, q)
    pairs = tuple(zip(found.frequencies.tolist(), found.ratios.tolist(), strict=True))
    return {"flexible": {body.name: body.modal.frequencies.tolist() for body in bodies}, "vibrations": pairs}
