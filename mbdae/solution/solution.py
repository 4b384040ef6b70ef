"""Solution of a run: times, states, multipliers, statistics, and dense output."""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import backend
from ..arguments import as_numbers
from ..discovery import lazy_import
from ..errors import SUCCESS, InputError
from ..mechanism import Contact, Effort, Impact, Mechanism, NotCompiled, Reaction, Singular, contact, effort, redundant
from ..system import Array
from ..tabular import Columns, Tabular
from ..textbook.hessenberg import Hessenberg
from ..units import elapsed, quantity, time_span, unit_name
from .archive import read, write
from .columns import reaction_of
from .dense_output import DenseOutput
from .sampling import derivatives_at_times
from .signals import signals, units
from .statistics import Statistics, statistics

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Sample(NamedTuple):
    """Configuration q (nq,) and velocity v (nv,) of a mechanism at a time, or a row for each of several times."""

    q: Array
    v: Array


@dataclass
class Solution(DenseOutput, Tabular):
    """A computed motion.

    Attributes:
        problem: the mechanism or textbook problem.
        t: times of the accepted steps or of ``t_eval``, (n,).
        y: points, (n, ...): (q, v, s, w) of a mechanism. At a jump there are two points, before and after it.
        z_own: the method's multipliers at t, (n, nz).
        status: one of `mbdae.errors.STATUS`; ``"finished"`` and ``"event"`` mean success.
        message: one line of text.
        stats: counts of steps, rejections, evaluations, solves, and seconds; ``"drift"`` of a mechanism, largest |g|
            at the ends of steps, in rad or characteristic lengths.
        settings: method, tolerances and step sizes of the run.
        steps: times, points and the method's multipliers at the ends of all steps, if ``t_eval`` requested other times.
        events: for each event function the times (k,) and points (k, ...) of its zeros.
        singular: configurations of the run in which closures lose rank.
        modes: states of ``mechanism.switches`` (stops, contacts, ...), and the first node of each.
        impacts: impacts of the run.
        resets: events at which the state jumped: the first node after each, and its name.
        carried: the carry of the method at each node except the last, (n - 1, nc), and the nodes where it was
            restarted; only for short runs, and not saved.
        external: the last states of FMUs that can save them, by the names of their forces.
        in_use: the sets of rows in use, each with its first node, if rows are redundant.
    """

    problem: Any
    t: Array
    y: Array
    z_own: Array
    status: str
    message: str
    stats: dict[str, Any]
    settings: dict[str, Any]
    steps: tuple[Array, Array, Array] | None = field(default=None, repr=False)
    events: list[tuple[Array, Array]] = field(default_factory=list, repr=False)
    singular: list[Singular] = field(default_factory=list, repr=False)
    in_use: list[tuple[int, tuple[int, ...]]] = field(default_factory=list, repr=False)
    modes: list[tuple[int, tuple[int, ...]]] = field(default_factory=list, repr=False)
    impacts: list[Impact] = field(default_factory=list, repr=False)
    resets: list[tuple[int, str]] = field(default_factory=list, repr=False)
    carried: tuple[Array, list[int]] | None = field(default=None, repr=False)
    external: dict[str, bytes] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        super().__init__()

    @cached_property
    def system(self) -> Any:
        """A separate workspace for multipliers and dense output; its work is not counted in the run.

        It uses the compiled core if the core computed the run and is available.
        """
        native = backend.load() if self.stats.get("backend") == "native" else None
        if native:
            with suppress(NotCompiled):
                return self.problem.system(native=native)
        return self.problem.system()

    @property
    def success(self) -> bool:
        """Whether the run reached its end without accuracy warnings."""
        return self.status in SUCCESS

    @property
    def ended(self) -> bool:
        """Whether the run reached its end, with or without accuracy warnings."""
        return self.success or self.status == "doubtful"

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism.

        Raises:
            InputError: for a textbook problem.
        """
        if not isinstance(self.problem, Mechanism):
            raise InputError("a textbook problem has y and z, not q, v and lam")
        return self.problem

    @property
    def q(self) -> Array:
        """Configurations, (n, nq)."""
        return self.y[:, : self.mechanism.nq]

    @property
    def v(self) -> Array:
        """Velocities, (n, nv)."""
        return self.y[:, self.mechanism.nq : self.mechanism.nq + self.mechanism.nv]

    @property
    def s(self) -> Array:
        """States of actuators and controllers, (n, ns), in the order of ``mechanism.states``."""
        return self.y[:, self.mechanism.nq + self.mechanism.nv : -1]

    @property
    def work(self) -> Array:
        """Work of the non-conservative forces since the start in J, integrated with the motion, (n,)."""
        return self.y[:, -1]

    @property
    def lam_own(self) -> Array:
        """Multipliers of the method, (n, ng): minimum norm, finite in singular configurations, of lower order."""
        return self.z_own[:, : self.mechanism.ng]

    @cached_property
    def derivatives(self) -> tuple[Array, Array]:
        """Rates y' (n, ny) and multipliers (n, nz) from the hidden constraint at each t, of the order of y.

        NaN where they cannot be computed, for instance in the singular configuration that ended a run.
        """
        return derivatives_at_times(self)

    @property
    def z(self) -> Array:
        """Multipliers from the hidden constraint at each t, (n, nz)."""
        return self.derivatives[1]

    @property
    def vdot(self) -> Array:
        """Accelerations v', (n, nv)."""
        return self.derivatives[0][:, self.mechanism.nv : 2 * self.mechanism.nv]

    @property
    def lam(self) -> Array:
        """Multipliers from the hidden constraint 0 = G v' + gamma, (n, ng); of the order of v.

        They act on the mechanism; rows are in file order; redundant rows have the minimum norm. For slipping joints and
        sliding no-slip rows, which are inactive, they are the friction forces.
        """
        return self.z[:, : self.mechanism.ng]

    def reaction(self, name: str) -> Reaction:
        """Return force (N) and torque (N m) of a joint, a closure, or a driven distance, from `lam`.

        Raises:
            UnknownNameError: for an unknown name.
            InputError: for a coupling or a driver of joints: see `effort`.
        """
        return reaction_of(self, name)

    def contact(self, name: str) -> Contact:
        """Return the contact forces (N) and contact points of a rolling body, and its required friction, from `lam`.

        Raises:
            UnknownNameError: if the name is not that of a rolling closure.
        """
        return contact(self.mechanism, name, self.t, self.q, self.lam)

    def effort(self, name: str) -> Effort:
        """Return torque or force (N m, N) and power (W) of a coupling, a driver or a joint's friction, from `lam`.

        Raises:
            UnknownNameError: for an unknown name.
            InputError: for a closure between frames: see `reaction`.
        """
        return effort(self.mechanism, name, self.t, self.q, self.lam, self.v)

    @property
    def redundant(self) -> dict[str, int]:
        """Closures with non-unique reactions, and the number of their redundant rows, at the start."""
        return redundant(self.mechanism, self.t[0], self.q[0])

    def __call__(self, t: float | Array) -> Sample:
        """Return q and v by dense output at a time, (nq,) and (nv,), or at several times, (n, nq) and (n, nv).

        Raises:
            InputError: for a time outside the run, or a textbook problem, for which see `point`.
        """
        m, times = self.mechanism, as_numbers(t)
        y = np.array(list(self.points(times.ravel()))).reshape(*times.shape, self.y.shape[1])
        return Sample(y[..., : m.nq], y[..., m.nq : m.nq + m.nv])

    def statistics(self, names: str | Sequence[str]) -> Statistics:
        """Return extrema, means, RMS values and integrals of signals, from the solution between the steps.

        Args:
            names: one or several names of `signals`; a prefix selects all names that begin with it.

        Raises:
            UnknownNameError: for an unknown signal.
            InputError: for a textbook problem, or a solution without times.
        """
        return statistics(self, names)

    def signals(self, names: str | Collection[str] | None = None) -> dict[str, Array]:
        """Return named columns of equal length, see `mbdae.solution.signals.signals`; y and z of a textbook problem."""
        if isinstance(self.problem, Mechanism):
            return signals(self, names)
        arrays = {"y": self.y, "z": self.z}
        return {"t": self.t} | {f"{n}.{k + 1}": x[:, k] for n, x in arrays.items() for k in range(x.shape[1])}

    def to_columns(self) -> Columns:
        """Return the columns of `signals` over time, with their units."""
        column_units = units(self.problem) if isinstance(self.problem, Mechanism) else {"t": "s"}
        return Columns(self.signals(), column_units, "t")

    def plot(self, names: str | Sequence[str] = (), *, path: str | Path | None = None) -> "Figure":
        """Draw signals over time, grouped by unit; saved if a path is given.

        Args:
            names: one or several names of `signals`, or a prefix: ``"q"``; when left out, coordinates, velocities,
                residuals and energy, or y and z of a textbook problem.
            path: a file to save, .png, .svg, .pdf or .pgf.

        Raises:
            UnknownNameError: for an unknown signal.
            InputError: for another format, or an unwritable path.
        """
        figure = lazy_import("mbdae.studies.solve.figure", "motion")(self, names)
        return lazy_import("mbdae.studies.figures", "save_if_path")(figure, path)

    def save(self, path: str | Path) -> None:
        """Write a .npz file without pickles (arrays; mechanism, settings and versions as JSON text), or a .csv table.

        Raises:
            InputError: for a custom textbook problem, whose functions cannot be written, or an unwritable path.
        """
        write(self, path)

    @classmethod
    def load(cls, path: str | Path, *, meshes: Sequence[str | Path] = ()) -> "Solution":
        """Read the .npz file that `save` wrote; warns if another version of mbdae wrote it.

        Args:
            path: the file.
            meshes: folders from which meshes are read, besides the folder of the file and installed packages.

        Raises:
            InputError: for a missing or damaged file, or a file that unpacks to implausibly large arrays.
        """
        return cls(**read(path, meshes))

    def __repr__(self) -> str:
        title = getattr(self.problem, "title", "?")
        span = f"{len(self.t)} times from {time_span(self.t, 'g')}" if len(self.t) else "empty"
        return f"<Solution of {title}, {self.settings.get('method', '?')}: {span}, {self.status}>"

    def __str__(self) -> str:
        s = self.stats
        rejected = "-" if s["rejected"] is None else s["rejected"]
        work = f"{s['steps']} steps, {rejected} rejected, {s['solves']} solves"
        return (
            f"{self.status}: {self.message}, t = {quantity(self.nodes[0][-1], 's', '.9g')}\n"
            f"  {work}, {elapsed(s['seconds'])} {unit_name('s')}, {s['backend']}"
        )

    def _repr_html_(self) -> str | None:
        """HTML representation in notebooks."""
        visible = isinstance(self.problem, Mechanism) and len(self.t)
        return lazy_import("mbdae.studies.replay.replay", "notebook")(self) if visible else super()._repr_html_()


Problem = Mechanism | Hessenberg


def uninterrupted(sol: Solution) -> Solution:
    """Return a run of a study; raise KeyboardInterrupt, which ends the study, if the user interrupted the run."""
    if sol.status == "interrupted":
        raise KeyboardInterrupt
    return sol
