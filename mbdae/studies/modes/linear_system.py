"""Linearization of a mechanism as a system with inputs and outputs, for control."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import matrix_balance

from ...arguments import as_numbers
from ...data_types import JsonObject
from ...errors import InputError, UnknownNameError, as_list
from ...mechanism import Mechanism, ModelSource
from ...mechanism.equilibrium.equilibrium_equations import Statics
from ...mechanism.equilibrium.linearization import LinearMotion
from ...mechanism.equilibrium.spectrum import spectrum
from ...mechanism.forces.linear import LinearElement
from ...mechanism.formats.mechanism_file.parameter_units import function_units
from ...mechanism.signals.effort_signals import named_laws
from ...mechanism.time_functions.input_functions import Input, InputHistory, inputs_in
from ...mechanism.tree.coordinate_units import coordinate_units
from ...mechanism.tree.frames import WORLD, Pair, anchor, frame_names
from ...solution.problem import mechanism_of
from ...system import Array
from ...tabular import Columns, Tabular
from ...units import substituted
from ..statics.equilibrium import velocity_labels
from .operating_point import operating_point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...mechanism.mechanism import Coordinates

__all__ = ["linearize"]

AXES = "xyz"
N_FREQUENCIES = 400  # frequencies of a frequency response


@dataclass(frozen=True)
class LinearSystem(Tabular):
    """Result of `linearize`: z' = A z + B u, y = C z + D u, in perturbations from the operating point.

    Attributes:
        title: title of the mechanism.
        A: state matrix, (n, n).
        B: input matrix, (n, inputs).
        C: output matrix, (outputs, n).
        D: feedthrough matrix, (outputs, inputs).
        inputs: names of the inputs.
        outputs: names of the outputs.
        motion: the linearized motion; its ``state`` returns z for changes of q, v and s.
        units: units of the gains from each input to each output, (outputs, inputs); "" if unknown or dimensionless.
    """

    title: str
    A: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    motion: LinearMotion
    units: tuple[tuple[str, ...], ...]

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C and D, for ``scipy.signal.StateSpace(*s.matrices)`` and ``control.ss(*s.matrices)``."""
        return self.A, self.B, self.C, self.D

    def response(self, omega: Sequence[float] | Array) -> Array:
        """Return the response C (i omega - A)^-1 B + D at angular frequencies (k,) in rad/s, (k, outputs, inputs).

        Raises:
            InputError: for anything but finite numbers, and at an undamped eigenvalue, where the response is infinite.
        """
        numbers = as_numbers(omega)
        if numbers.ndim != 1 or not len(numbers) or not np.isfinite(numbers).all():
            raise InputError(f"a frequency response takes a list of frequencies, got {omega!r:.60}")
        identity = np.eye(len(self.A))
        with np.errstate(invalid="ignore"):  # scipy casts the scale factors to integers, too, for a permutation
            A, (d, _) = matrix_balance(self.A, permute=False, separate=True)  # scales positions and speeds
        B, C = self.B / d[:, None], self.C * d
        out = np.empty((len(numbers), *self.D.shape), complex)
        for k, w in enumerate(numbers):
            try:
                out[k] = C @ np.linalg.solve(1j * w * identity - A, B) + self.D
            except np.linalg.LinAlgError:
                raise InputError(f"the response is infinite at {w:.6g} rad/s, an eigenvalue of the system") from None
        return out

    def band(self) -> Array:
        """Return frequencies in Hz, from a tenth of the smallest |lambda| to ten times the largest, (k,)."""
        size = np.abs(spectrum(self.A, self.motion.noise).values)
        size = size[size > 0] if size.any() else np.array([2 * np.pi])
        return np.geomspace(size.min() / 10, size.max() * 10, N_FREQUENCIES) / (2 * np.pi)

    def plot(self, path: str | Path | None = None, hertz: Sequence[float] | Array | None = None) -> "Figure":
        """Draw gain and phase against frequencies in Hz, `band` when left out; saved if a path is given.

        Raises:
            InputError: for another format, an unwritable path, or frequencies as in `response`.
        """
        from .. import figures
        from .figure import frequency_response

        return figures.save_if_path(frequency_response(self, self.band() if hertz is None else as_numbers(hertz)), path)

    def to_columns(self) -> Columns:
        """Return gain and phase in rad of each output for each input, over the frequencies of `band`."""
        hertz = self.band()
        H = self.response(2 * np.pi * hertz)
        columns, units = {"frequency": hertz}, {"frequency": "Hz"}
        for i, output in enumerate(self.outputs):
            for j, name in enumerate(self.inputs):
                columns[f"gain {output} / {name}"] = np.abs(H[:, i, j])
                columns[f"phase {output} / {name}"] = np.unwrap(np.angle(H[:, i, j]))
                units |= {f"gain {output} / {name}": self.units[i][j], f"phase {output} / {name}": "rad"}
        return Columns(columns, {name: unit for name, unit in units.items() if unit}, "frequency")

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        matrices = {name: X.tolist() for name, X in zip("ABCD", self.matrices, strict=True)}
        return {"title": self.title, **matrices, "inputs": list(self.inputs), "outputs": list(self.outputs)}

    def __str__(self) -> str:
        n = len(self.A)
        return f"linear system of {self.title}: {n} states, inputs {', '.join(self.inputs) or 'none'}, outputs " + (
            ", ".join(self.outputs) or "none"
        )


def linearize(
    mech: Mechanism | ModelSource,
    q: "Coordinates | Array | None" = None,
    v: "Coordinates | Array | None" = None,
    *,
    inputs: str | Iterable[str] = (),
    outputs: str | Iterable[str] = (),
    t: float = 0.0,
    hold: str | Iterable[str] = (),
) -> LinearSystem:
    """Linearize a mechanism with inputs and outputs around an equilibrium or a steady motion.

        z' = A z + B u,   y = C z + D u

    in perturbations from that point, with exact partial derivatives of all forces; z are perturbations of (q, v, s)
    compatible with the closures.

    An input is the name of a joint (a torque on it in N m or N; ``joint.2`` for one of several coordinates), of a
    force whose value is a function of time (the voltage of a dc_motor, the reference of a joint_pid, the torque of a
    joint_torque; "(force)" is appended to a name shared with a joint, closure or driver), of an ``[[input]]`` of such
    forces only ("(input)" is appended to a name that is shared), or ``frame.x``, a force in N on a frame's
    origin along an axis of the world. An output is named as a signal of runs: ``q.joint`` or ``v.joint``
    (in the tangent), ``s.state``, or ``position.frame.x``, the position of a frame's origin in m. If the rate of a
    reference also enters (kd), the states are z minus the effect of its jump, which contributes to D.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        q: see `mbdae.modes`, also for v, t and hold.
        v: constant speeds.
        inputs: a joint, a force with a signal, an input of the file, or frame.x; several times for several.
        outputs: q.joint, v.joint, s.state or position.frame.x; all q and v when left out.
        t: time in s.
        hold: joints to lock.

    Returns:
        A (n, n), B (n, inputs), C (outputs, n), D (outputs, inputs), and derived results.

    Raises:
        UnknownNameError: for an unknown name; lists the valid ones.
        InputError, EquilibriumError: as for `mbdae.modes`.
    """
    mech = mechanism_of(mech, "linearize")
    statics, point, motion, _ = operating_point(mech, q, v, t, hold)
    chosen_inputs = as_list(inputs, "inputs is a list of names")
    joints = velocity_labels(mech, np.arange(mech.nv))
    chosen_outputs = as_list(outputs, "outputs is a list of names") or [f"{x}.{n}" for x in "qv" for n in joints]
    perturbation_map, Z, k = motion.perturbation_map, motion.Z, motion.Zp.shape[1]
    ns, n = len(point.s), len(motion.A)
    partials = _input_partials(statics, point.q, joints)
    columns, jumps = np.zeros((n, len(chosen_inputs))), np.zeros((n, len(chosen_inputs)))
    for j, name in enumerate(chosen_inputs):
        if name not in partials:
            raise UnknownNameError("input", name, partials)
        (tau, rates), (dtau, drates) = partials[name]
        columns[k : n - ns, j], columns[n - ns :, j] = Z.T @ tau, rates
        jumps[k : n - ns, j], jumps[n - ns :, j] = Z.T @ dtau, drates
    output_rows = _output_rows(statics, point.q, joints)
    for name in chosen_outputs:
        if name not in output_rows:
            raise UnknownNameError("output", name, output_rows)
    C = (
        np.array([output_rows[name] for name in chosen_outputs]).reshape(len(chosen_outputs), 2 * mech.nv + ns)
        @ perturbation_map
    )
    B, D = columns + motion.A @ jumps, C @ jumps
    return LinearSystem(mech.title, motion.A, B, C, D, tuple(chosen_inputs), tuple(chosen_outputs), motion,
                        _gain_units(mech, chosen_inputs, chosen_outputs))  # fmt: skip


def _gain_units(mech: Mechanism, inputs: Sequence[str], outputs: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return the units of the gains, see `LinearSystem`."""
    rates = [unit for name, unit in coordinate_units(mech).items() if name.startswith("v.")]
    joints = velocity_labels(mech, np.arange(mech.nv))
    of_inputs = {n: "N" if u == "m/s" else "N m" for n, u in zip(joints, rates, strict=True)} | function_units(mech)
    of_outputs = {f"v.{n}": u for n, u in zip(joints, rates, strict=True)}
    of_outputs |= {f"q.{n}": u.removesuffix("/s") for n, u in zip(joints, rates, strict=True)}
    of_outputs |= {name: "m" for name in outputs if name.startswith("position.")}
    frames = {f"{name}.{axis}": "N" for name in frame_names(mech.model)[1:] for axis in AXES}
    of_inputs |= {name: x.unit for name, x in inputs_in(mech.forces).items() if isinstance(x, Input)}
    return tuple(
        tuple(_quotient(of_outputs.get(o, ""), (frames | of_inputs).get(i, "")) for i in inputs) for o in outputs
    )


def _quotient(numerator: str, denominator: str) -> str:
    return substituted("y/x", {"y": numerator, "x": denominator}) if numerator and denominator else ""


InputPartials = tuple[tuple[Array, Array], tuple[Array, Array]]


def _input_partials(statics: Statics, q: Array, joints: Sequence[str]) -> dict[str, InputPartials]:
    """Return for each input the partial derivatives of (f, h), and those with respect to its rate."""
    system = statics.system
    nv, ns = system.nv, system.ns
    none = np.zeros(ns)
    out: dict[str, InputPartials] = {
        n: ((e, none), (np.zeros(nv), none)) for n, e in zip(joints, np.eye(nv), strict=True)
    }
    states = {id(law): at for law, at in system.laws.bound}
    named: dict[str, Array] = {}
    for force, law in named_laws(statics.mech, system.laws).items():
        if not isinstance(law, LinearElement):
            continue
        at = states[id(law)]
        for i, u in enumerate(law.u):
            derivatives = np.zeros((2, nv + ns))
            for row, r, column, c, value in law.terms:
                if column in ("u", "du") and c == i:
                    derivatives[int(column == "du"), r if row == "tau" else nv + at.start + r] += value
            out[force if len(law.u) == 1 else f"{force}.{i + 1}"] = _split(derivatives, nv)
            if isinstance(u, Input | InputHistory):
                named[u.name] = named.get(u.name, 0.0) + derivatives
    for name in named.keys() - _inputs_of_other_elements(statics):
        out[f"{name} (input)" if name in out else name] = _split(named[name], nv)
    for name, derivative in _position_partials(statics, q).items():
        out.setdefault(name, ((derivative, none), (np.zeros(nv), none)))
    return out


def _split(derivatives: Array, nv: int) -> InputPartials:
    """Split rows of partial derivatives with respect to a signal and its rate (2, nv + ns) into those of f and h."""
    return (derivatives[0, :nv], derivatives[0, nv:]), (derivatives[1, :nv], derivatives[1, nv:])


def _inputs_of_other_elements(statics: Statics) -> set[str]:
    """Return the names of inputs of drivers and of nonlinear forces."""
    laws = (law for law, _ in statics.system.laws.bound if not isinstance(law, LinearElement))
    signals = [*(u for law in laws for u in law.time_functions), *(d.path for d in statics.mech.drivers)]
    return {u.name for u in signals if isinstance(u, Input | InputHistory)}


def _output_rows(statics: Statics, q: Array, joints: Sequence[str]) -> dict[str, Array]:
    """Return for each output its partial derivatives with respect to (q, v, s), (2 nv + ns,)."""
    nv, names = statics.system.nv, list(statics.mech.states)
    rows = np.eye(2 * nv + len(names))
    out = {f"q.{n}": rows[i] for i, n in enumerate(joints)} | {f"v.{n}": rows[nv + i] for i, n in enumerate(joints)}
    out |= {f"s.{n}": rows[2 * nv + i] for i, n in enumerate(names)}
    positions = {f"position.{n}": derivative for n, derivative in _position_partials(statics, q).items()}
    return out | {n: np.pad(derivative, (0, nv + len(names))) for n, derivative in positions.items()}


def _position_partials(statics: Statics, q: Array) -> dict[str, Array]:
    """Return the partial derivatives (nv,) of the positions ``frame.x`` of all frames."""
    system, out = statics.system, {}
    statics.force(q, np.zeros(system.ns))  # updates kinematics at q
    for name in frame_names(system.model)[1:]:
        at = anchor(system.model, name)
        if at.joint == 0:
            continue
        pair = Pair(system.model, system.workspace, anchor(system.model, WORLD), at)
        pair.locate()
        for axis, n in zip(AXES, np.eye(3), strict=True):
            out[f"{name}.{axis}"] = pair.generalized_force(np.concatenate([n, np.cross(pair.pb, n)]))
    return out
