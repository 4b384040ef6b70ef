"""Vibration modes of a mechanism, and growth or decay of perturbations."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, StepError, is_number
from ...mechanism import Mechanism, ModelSource
from ...mechanism.equilibrium.linearization import LinearMotion
from ...mechanism.equilibrium.null_space import project_configuration
from ...mechanism.equilibrium.spectrum import CERTAIN, Spectrum, spectrum
from ...mechanism.tree.coordinate_units import coordinate_units
from ...solution.problem import mechanism_of
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular, align_columns
from ...units import common_unit, displayed, quantity, unit_name
from ..statics.equilibrium import velocity_labels
from .operating_point import operating_point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...mechanism.mechanism import Coordinates

__all__ = ["modes"]

DIGITS = 9  # decimal places of log |lambda| in sorting, so that conjugate pairs stay together
FRAMES, SECONDS = 121, 2.0  # number of frames and duration of one cycle in a replay
AMPLITUDE = 0.25  # default amplitude of a replay in rad or m
MAX_COMPONENTS = 3  # largest number of components of a shape shown as text
SHOWN = 0.01  # fraction of the largest component below which components are not shown


@dataclass(frozen=True)
class Modes(Tabular):
    """Result of `modes`.

    Attributes:
        mechanism: the mechanism.
        t: time in s.
        motion: the linearized motion: A, and its point q, v, s.
        around: ``"start"``, ``"given"``, ``"equilibrium"`` or ``"steady motion"``.
        spectrum: eigenvalues of A by magnitude, with eigenvectors.
        locked: velocity indices of the locked coordinates.
    """

    mechanism: Mechanism
    t: float
    motion: LinearMotion
    around: str
    spectrum: Spectrum
    locked: Array

    @property
    def eigenvalues(self) -> Array:
        """Eigenvalues of A, (n,), by magnitude; those of symmetries are 0, as are parts that are rounding errors."""
        return self.spectrum.values

    @cached_property
    def roots(self) -> Array:
        """One eigenvalue for each mode, (k,): of conjugate pairs the one with positive imaginary part."""
        return self.eigenvalues[self.eigenvalues.imag >= 0]

    @property
    def frequencies(self) -> Array:
        """|Im|/(2 pi) of each mode in Hz, (k,)."""
        return self.roots.imag / (2 * np.pi)

    @property
    def damping(self) -> Array:
        """Damping ratio -Re/|lambda| of each mode, (k,): 1 aperiodic, 0 undamped, negative growing; nan for 0."""
        size = np.abs(self.roots)
        return np.divide(0.0 - self.roots.real, size, out=np.full(len(size), np.nan), where=size > 0)

    @cached_property
    def shapes(self) -> Array:
        """Shape dq of each mode, (k, nv), complex, with dq^H M dq = 1 and its largest component real.

        The shape is 0 for a mode of states only, such as a current, and for the speed of a free motion.
        """
        n = self.motion.Zp.shape[1]
        shapes = self.motion.Zp @ self.spectrum.vectors[:n, self.eigenvalues.imag >= 0]
        return np.array([self._normalized(dq) for dq in shapes.T]).reshape(-1, self.mechanism.nv)

    def _normalized(self, dq: Array) -> Array:
        size = np.linalg.norm(self.motion.free.U @ dq)
        if not size:
            return np.zeros(len(dq), complex)
        largest = dq[np.abs(dq).argmax()]
        return dq * (abs(largest) / (largest * size))

    def displayed_shape(self, i: int) -> tuple[Array, list[str]]:
        """Return the shape of mode i (nv,) in display units, scaled to a largest component of 1, and the units."""
        names = [name for name in coordinate_units(self.mechanism).items() if name[0].startswith("v.")]
        found = [displayed(x, unit.removesuffix("/s")) for x, (_, unit) in zip(self.shapes[i], names, strict=True)]
        shape = np.array([x for x, _ in found])
        return shape / (np.abs(shape).max(initial=0.0) or 1.0), [unit for _, unit in found]

    @property
    def stable(self) -> bool:
        """Whether no eigenvalue has a significant positive real part."""
        return not self.spectrum.growing.any()

    @property
    def free_below(self) -> float:
        """Frequency in rad/s below which modes cannot be distinguished from free motions; 0 if there are none."""
        (k, m), zeros = (self.motion.Zp.shape[1], self.motion.Z.shape[1]), self.eigenvalues == 0
        x = np.abs(self.spectrum.vectors[:k, zeros])
        size = np.linalg.norm(x, axis=0)
        stiffness = np.linalg.norm(self.motion.noise[k : k + m, :k] @ x, axis=0)[size > 0] / size[size > 0]
        return float(np.sqrt(CERTAIN * stiffness.max(initial=0.0)))

    def configurations(self, i: int, amplitude: float | None = None) -> Array:
        """Return one cycle of mode i, (121, nq): q (+) a Re(e^(i phi) dq), with the loops closed.

        Args:
            i: index of the mode.
            amplitude: the largest displacement of a coordinate in rad or m; 0.25 when left out.

        Raises:
            InputError: for an amplitude that is not positive.
        """
        a = AMPLITUDE if amplitude is None else amplitude
        if not (is_number(a) and a > 0):
            raise InputError(f"the amplitude must be a positive number in rad or m, got {a!r:.40}")
        system, shape = self.mechanism.system(), self.shapes[i]
        largest = np.abs(shape).max() or 1.0
        out = np.empty((FRAMES, self.mechanism.nq))
        for k, phi in enumerate(np.linspace(0, 2 * np.pi, FRAMES)):
            x = a / largest * (np.exp(1j * phi) * shape).real
            out[k] = system.manifold.integrate(self.motion.q, x)
            try:
                out[k] = project_configuration(system, self.t, out[k], locked=self.locked)
            except StepError:  # the replay shows violated closures if the amplitude is too large for them
                continue
        return out

    def animate(self, path: str | Path, amplitude: float | None = None) -> Path:
        """Write a replay page of all modes with a shape, one cycle each; a selector in the page chooses the mode.

        Args:
            path: ``.html``.
            amplitude: the largest displacement of a coordinate in rad or m; 0.25 when left out.

        Returns:
            The path written.

        Raises:
            InputError: for another suffix, an unwritable path, or an amplitude that is not positive.
        """
        from ..replay.replay import animate

        shown = [i for i in range(len(self.roots)) if self.shapes[i].any()]
        runs = {f"mode {i + 1}: {self.describe(i)}": self._run(self.configurations(i, amplitude)) for i in shown}
        first = next(iter(runs.values()), self._run(np.repeat(self.motion.q[None], FRAMES, 0)))
        return animate(first, path, plots=(), choices=runs)

    def _run(self, q: Array) -> Solution:
        mech, t = self.mechanism, np.linspace(0.0, SECONDS, FRAMES)
        constant = np.concatenate([np.zeros(mech.nv), self.motion.s, [0.0]])
        y = np.hstack([q, np.repeat(constant[None], FRAMES, 0)])
        return Solution(mech, t, y, np.zeros((FRAMES, mech.ng)), "finished", "", {}, {})

    def describe(self, i: int) -> str:
        """Return frequency and damping of a mode in words."""
        root = self.roots[i]
        if root == 0:
            return "free"
        if root.imag:
            return f"{self.frequencies[i]:.4g} Hz, damping {self.damping[i]:.3g}"
        return f"{'grows' if root.real > 0 else 'decays'}, {quantity(abs(root.real), '1/s', '.4g')}"

    def to_dict(self) -> JsonObject:
        """Return JSON data; eigenvalues as pairs [re, im]."""
        names = velocity_labels(self.mechanism, np.arange(self.mechanism.nv))
        rows = zip(self.roots.tolist(), self.frequencies, self.damping, self.shapes, strict=True)
        return {
            "title": self.mechanism.title,
            "around": self.around,
            "stable": self.stable,
            "free_below": self.free_below,
            "q": self.motion.q.tolist(),
            "v": self.motion.v.tolist(),
            "eigenvalues": [[z.real, z.imag] for z in self.eigenvalues.tolist()],
            "modes": [
                {
                    "eigenvalue": [root.real, root.imag],
                    "frequency": float(f),
                    "damping": float(d),
                    "shape": {n: [x.real, x.imag] for n, x in zip(names, shape.tolist(), strict=True)},
                }
                for root, f, d, shape in rows
            ],
        }

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw the eigenvalues in the complex plane, and the shapes; saved if a path is given.

        Raises:
            InputError: for a format other than .png, .svg, .pdf or .pgf, or an unwritable path.
        """
        from .. import figures
        from .figure import roots

        return figures.save_if_path(roots(self), path)

    def to_columns(self) -> Columns:
        """Return eigenvalue, frequency and damping of each mode."""
        numbers = {"frequency": self.frequencies, "damping": self.damping}
        columns = {"re": self.roots.real, "im": self.roots.imag, **numbers}
        return Columns(columns, {"re": "1/s", "im": "1/s", "frequency": "Hz", "damping": "1"})

    def cells(self) -> list[list[str]]:
        """Return eigenvalues, frequencies, damping ratios, and dominant coordinates."""
        names = velocity_labels(self.mechanism, np.arange(self.mechanism.nv))
        headers = ["mode", f"eigenvalue in {unit_name('1/s')}", "", "Hz", "damping", "moves most"]
        body = []
        for i, root in enumerate(self.roots):
            shape, units = self.displayed_shape(i)
            size, mixed = np.abs(shape), "," in common_unit(units)
            order = [j for j in np.argsort(-size, kind="stable")[:MAX_COMPONENTS] if size[j] > SHOWN]
            dominant = ", ".join(f"{names[j]} {size[j]:.2g}{f' {units[j]}' if mixed else ''}" for j in order) or (
                "states" if root else "its speed"
            )
            shown = displayed(root, "1/s")[0]
            pair = f"+- {shown.imag:.10g} i" if root.imag else ""
            damping = f"{self.damping[i]:.4g}" if root else "-"
            hertz = f"{self.frequencies[i]:.6g}"
            body.append([str(i + 1), f"{shown.real:.10g}", pair, hertz, damping, dominant])
        return [headers, *body]

    def __str__(self) -> str:
        words = "stable" if self.stable else "unstable"
        around = "given configuration" if self.around == "given" else self.around
        title = f"modes of {self.mechanism.title} around its {around}: {words}"
        lines = [title, "", *align_columns(self.cells())]
        if self.free_below:
            largest = np.abs(self.eigenvalues).max()
            scale = f" (largest |lambda| {quantity(largest, 'rad/s', '.2g')})" if largest else ""
            below = quantity(self.free_below, "rad/s", ".1g")
            lines.append(f"modes below {below} cannot be distinguished from free ones{scale}")
        return "\n".join(lines)


def modes(
    mech: Mechanism | ModelSource,
    q: "Coordinates | Array | None" = None,
    v: "Coordinates | Array | None" = None,
    *,
    t: float = 0.0,
    hold: str | Iterable[str] = (),
) -> Modes:
    """Compute the vibration modes around an equilibrium or a steady motion.

    Eigenvalues lambda and shapes dq of dq ~ exp(lambda t), G dq = 0, from the exact partial derivatives of all forces,
    including G^T lam; with gyroscopic terms, states of controllers, and velocity rows.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        q: a full configuration (nq,), used unchanged; or joint values by name from which the equilibrium is searched.
            When left out, the start if it is steady, else the equilibrium found from there.
        v: constant speeds by joint, or a full velocity (nv,), of a steady motion.
        t: time in s, at which drivers and functions of time are frozen.
        hold: joints to lock.

    Returns:
        Eigenvalues, frequencies, damping ratios and shapes.

    Raises:
        InputError: for a configuration that is neither an equilibrium nor a steady motion, for a loss of rank of the
            closures, or without degrees of freedom.
        EquilibriumError: if no equilibrium is found.
    """
    mech = mechanism_of(mech, "modes")
    statics, _, motion, around = operating_point(mech, q, v, t, hold)
    found = spectrum(motion.A, motion.noise)
    size = np.log(np.abs(found.values), out=np.full(len(motion.A), -np.inf), where=found.values != 0)
    order = np.lexsort((-found.values.imag, found.values.real, np.round(size, DIGITS)))
    return Modes(mech, t, motion, around, found.sorted(order), statics.locked)
