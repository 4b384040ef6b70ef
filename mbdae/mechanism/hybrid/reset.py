"""Resets, user-defined events at which the state jumps: leg exchange of a walker, velocities after an impact.

At the event the state becomes R(t, y): coordinates are assigned by a table or a function; then the other positions are
solved for closures and drivers, and velocities satisfy them by the impact law

    M (v+ - v) = G^T P,   G v+ + g_t = 0

With switches the assigned state is treated as a start: contacts that the event opens are inactive, closed contacts
follow their impact law (`impact`), and an active-set selection follows. The change of energy counts as work.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from ...callbacks import call_with_views, checked_value, function_name
from ...discovery import lazy_import
from ...errors import InputError, StepError, UnknownNameError
from ...finite_differences import numerical_derivative, numerical_jacobian
from ...system import Array
from ...tolerances import EPS, SUM_ROUNDING, VISIBLE
from ..checked_table import Table
from ..key_units import Coordinates
from .state_expressions import Expression, state_columns

if TYPE_CHECKING:
    from ..discrete_sensitivity.point_sensitivity import PointSensitivity
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

ITERATIONS = 20
WIDTH = 1e-3  # width of difference quotients of a user function, in rad, characteristic lengths, speeds and times
StateMap = Callable[[float, Array, Array], tuple[Array, Array]]


class Reset(Table):
    """An event at which the state jumps.

    Attributes:
        name: name of the event.
        signal: signal and level whose crossing is the event, as for `mbdae.Event`: ``"position.foot.z < 0"`` falling,
            ``"="`` both ways. Unlike for `mbdae.Event`, the level is required.
        when: signal and level as a condition, ``"q.swing > 0.1"``: other crossings do not count.
        state: new values of coordinates and states, as numbers or expressions of the old values:
            ``{ "q.left" = "q.right", "v.left" = "-v.left" }``; other values remain, or are solved to close the loops.
        function: name of a Python function that returns (q, v) after the event, see `of_function`; not in a file.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown coordinate.
    """

    name: str = Field(min_length=1)
    signal: str = Field(min_length=1)
    when: str = ""
    state: Annotated[dict[str, float | str], Coordinates()] = Field(default_factory=dict)
    function: str = ""
    _call: StateMap | None = PrivateAttr(None)
    _partials: Callable[[float, Array, Array], Array] | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _check_map(self) -> "Reset":
        if bool(self.state) == bool(self.function):
            raise ValueError("an event needs a table state of new values")
        return self

    @classmethod
    def of_function(
        cls,
        function: StateMap,
        signal: str,
        when: str = "",
        *,
        partials: Callable[[float, Array, Array], Array] | None = None,
        name: str = "",
    ) -> "Reset":
        """Return an event with a Python function (q, v) = function(t, q, v) for the state after it.

        Args:
            function: returns q (nq,) and v (nv,); closures are satisfied afterwards, by the impact law.
            signal: signal and level whose crossing is the event.
            when: signal and level as a condition.
            partials: derivatives of (q, v) after the event with respect to (q, v) before it, (2 nv, 2 nv), q in the
                tangents at both; finite differences when left out. Those with respect to t are always differences.
            name: the function's name when left out.

        Raises:
            InputError: for values that are not functions.
        """
        for what, given in (("function", function), ("partials", partials)):
            if not (callable(given) or (given is None and what == "partials")):
                raise InputError(f"{what} of an event is a function of (t, q, v), got {given!r:.60}")
        out = cls(name=name or function_name(function), signal=signal, when=when, function=function_name(function))
        out._call, out._partials = function, partials
        return out


class ResetMap:
    """The map R of an event, bound to a workspace.

    Args:
        system: a workspace.
        reset: the event.

    Raises:
        InputError: for a value of an unknown coordinate, an invalid expression, or a function that is not available.
    """

    def __init__(self, system: "Index2System", reset: Reset) -> None:
        self.system, self.reset, mech = system, reset, system.mechanism
        if reset.function and reset._call is None:
            missing = f"{reset.function!r} is a Python function and not in the file: load the mechanism with it again"
            raise InputError(f"event {reset.name!r}: {missing}")
        self.columns, self.values = state_columns(mech), assignments(mech, reset)
        listed = {self.columns[name][1] for name in self.values if name.startswith("q.")}
        self.free = np.array([i for i in range(mech.nv) if i not in listed], int)

    def __call__(self, t: float, y: Array) -> Array:
        """Return y after the event, (n,).

        Raises:
            StepError: if a value cannot be computed, or closures cannot be satisfied.
        """
        out = self.assembled(t, y)
        return self.with_work(y, self.system.project_state(t, out) if self.system.ng else out)

    def with_work(self, before: Array, after: Array) -> Array:
        """Return y after the event (n,), with work that includes the change of energy."""
        out = after.copy()
        out[-1] = before[-1] + sum(self._energy(after)) - sum(self._energy(before))
        return out

    def assembled(self, t: float, y: Array) -> Array:
        """Return y (n,) with the values of the table, and positions that satisfy closures; velocities may violate them.

        Raises:
            StepError: if a value cannot be computed, or the values contradict a closure or a driver.
        """
        return self._assembled(t, self._assigned(t, y))

    def partials(self, sensitivity: "PointSensitivity", t: float, y: Array) -> Array:
        """Return the derivatives of y after the event with respect to (y, p, t), (ny, ny + k + 1), for fixed modes."""
        s, ny, k = self.system, sensitivity.ny, sensitivity.k
        closed, out = self.assembled(t, y), self.assembled_partials(sensitivity, t, y)
        if not s.ng:
            return self.with_work_partials(sensitivity, y, closed, out)
        P, time = sensitivity.projection(t, closed), out[:, -1:].copy()
        out, after = P[:, :ny] @ out, s.project_state(t, closed)
        out[:, ny : ny + k] += P[:, ny:]
        if s.mechanism.drivers:
            rate = numerical_derivative(lambda x: s.difference(after, s.project_state(t + x, closed)), self._width)
            out[:, -1] = P[:, :ny] @ time[:, 0] + rate
        return self.with_work_partials(sensitivity, y, after, out)

    @property
    def _width(self) -> float:
        """Width of differences in time, in s."""
        return WIDTH / self.system.mechanism.characteristic_rate

    def with_work_partials(self, sensitivity: "PointSensitivity", before: Array, after: Array, out: Array) -> Array:
        """Return partials (ny, ny + k + 1) of y after an event, including its work; see `with_work`."""
        ny, k = sensitivity.ny, sensitivity.k
        energy = [sensitivity.energy(*self.system.split(x)).sum(axis=0) for x in (before, after)]
        found = np.vstack([out, np.eye(k, ny + k + 1, ny)])
        found[ny - 1] = 0.0
        row = energy[1] @ found
        row[:-1] -= energy[0]
        row[ny - 1] += 1.0
        return np.vstack([out[:-1], row])

    def assembled_partials(self, sensitivity: "PointSensitivity", t: float, y: Array) -> Array:
        """Return the derivatives of `assembled` with respect to (y, p, t), (ny, ny + k + 1)."""
        s, nv, ny, k = self.system, self.system.nv, sensitivity.ny, sensitivity.k
        assigned = self._assigned(t, y)
        closed = self._assembled(t, assigned)
        out = np.zeros((ny, ny + k + 1))
        out[:, np.r_[0:ny, -1]] = self._assigned_partials(t, y, assigned)
        perturbed = zip(sensitivity.parameters.all, self.perturbed_resets(sensitivity), strict=True)
        for i, (p, resets) in enumerate(perturbed):
            if any(reset != self.reset for reset in resets.values()):
                maps = {j: ResetMap(s, reset) for j, reset in resets.items()}
                out[:, ny + i] = p.quotient({j: s.difference(assigned, m._assigned(t, y)) for j, m in maps.items()})
        q, rows = s.split(closed)[0], self._position_rows
        if not len(rows) or self.reset.function:
            return out
        G = s.jacobian(q)[rows]
        residual = G @ out[:nv]
        residual[:, ny : ny + k] += sensitivity.parameters.row_partials(t, q, np.zeros(nv))[1][rows]
        residual[:, -1] += s.g_t(t)[rows]
        out[self.free] -= np.linalg.lstsq(G[:, self.free], residual, rcond=SUM_ROUNDING)[0]
        return out

    @property
    def _position_rows(self) -> Array:
        """Indices of the rows that positions must satisfy: closures and drivers without a switch."""
        positional = np.flatnonzero(self.system.constraints.positional)
        return np.setdiff1d(positional, [row for switch in self.system.mechanism.switches for row in switch.rows])

    def perturbed_resets(self, sensitivity: "PointSensitivity") -> list[dict[int, Reset]]:
        """Return this event in the mechanisms with perturbed parameters, by index of the perturbation."""
        i = [reset.name for reset in self.system.mechanism.resets].index(self.reset.name)
        return [{j: mech.resets[i] for j, mech in p.perturbed.items()} for p in sensitivity.parameters.all]

    def _energy(self, y: Array) -> tuple[float, float]:
        return self.system.energy(*self.system.split(y))

    def _assigned(self, t: float, y: Array) -> Array:
        """Return y with the values of the table or of the function."""
        out, s = y.copy(), self.system
        if self.reset._call is None:
            for name, value in self.values.items():
                out[self.columns[name][0]] = value.value(t, y)
            return out
        what = f"event {self.reset.name!r}"
        found = call_with_views(what, self.reset._call, t, *s.split(y))
        if not isinstance(found, tuple | list) or len(found) != 2:
            raise StepError("force", f"{what} returned {found!r:.60}, expected (q, v)")
        out[: s.nq] = checked_value(found[0], (s.nq,), t, f"q of {what}")
        out[s.nq : s.nq + s.nv] = checked_value(found[1], (s.nv,), t, f"v of {what}")
        return out

    def _assigned_partials(self, t: float, y: Array, after: Array) -> Array:
        """Return the derivatives of `_assigned` with respect to (y, t), (ny, ny + 1)."""
        s, ny, nv = self.system, self.system.ny, self.system.nv
        out = np.eye(ny, ny + 1)
        for name, value in self.values.items():
            out[self.columns[name][1]] = value.partials(t, y, ny)
        if self.reset._call is not None:
            out[: 2 * nv, : 2 * nv] = self._function_partials(t, y, after)
            out[:, -1] = numerical_derivative(lambda x: s.difference(after, self._assigned(t + x, y)), self._width)
        return out

    def _function_partials(self, t: float, y: Array, after: Array) -> Array:
        """Return the partials of (q, v) after the event, (2 nv, 2 nv): as given, or finite differences."""
        s, n = self.system, 2 * self.system.nv
        if self.reset._partials is not None:
            what = f"partials of event {self.reset.name!r}"
            return checked_value(call_with_views(what, self.reset._partials, t, *s.split(y)), (n, n), t, what)

        def displacement(x: Array) -> Array:
            return s.difference(after, self._assigned(t, s.add(y, np.pad(x, (0, s.ny - n)))))[:n]

        return numerical_jacobian(displacement, n, WIDTH * s.mechanism.motion_scales)

    def _assembled(self, t: float, y: Array) -> Array:
        """Return y with the positions not in the table solved for closures, see `assembled`."""
        s, q = self.system, y[: self.system.nq]
        rows, scales = self._position_rows, s.mechanism.row_scales
        if not len(rows) or self.reset.function:
            return y
        last = np.inf
        for _ in range(ITERATIONS):
            g, G = (x[rows] for x in s.closures(q, t))
            size = float(np.abs(g / scales[rows]).max())
            if not EPS < size < last:
                break
            last, x = size, np.zeros(s.nv)
            x[self.free] = -np.linalg.lstsq(G[:, self.free], g, rcond=SUM_ROUNDING)[0]
            q = s.manifold.integrate(q, x)
        if not size <= VISIBLE:
            name = s.mechanism.row_names[rows[int(np.abs(g / scales[rows]).argmax())]]
            raise StepError("newton", f"values of event {self.reset.name!r} contradict {name!r}, at t = {t:.9g}")
        return np.concatenate([q, y[s.nq :]])


def assignments(mech: "Mechanism", reset: Reset) -> dict[str, Expression]:
    """Return the expressions of an event by coordinate.

    Raises:
        InputError, UnknownNameError: for an unknown coordinate, or an invalid expression.
    """
    columns = state_columns(mech)
    for name in reset.state:
        if name not in columns:
            raise UnknownNameError(f"coordinate of event {reset.name!r}", name, columns)
    return {name: Expression(value, columns) for name, value in reset.state.items()}


def checked_resets(mech: "Mechanism", resets: Sequence[Reset]) -> tuple[Reset, ...]:
    """Return the events of a mechanism.

    Raises:
        InputError, UnknownNameError: for unknown coordinates or signals, equal names, or closures in ranges.
    """
    names = [reset.name for reset in resets]
    if len(set(names)) < len(names):
        raise InputError(f"events need different names, got {', '.join(names)}")
    for reset in resets:
        assignments(mech, reset)
        ranged = [c.name for c in mech.closures if c.within]
        if ranged:
            why = "is active only in ranges, which events that change the state do not support"
            raise InputError(f"event {reset.name!r}: closure {ranged[0]!r} {why}")
    if resets:
        lazy_import("mbdae.integrate.events.resets", "require_known_signals")(mech, resets)
    return tuple(resets)
