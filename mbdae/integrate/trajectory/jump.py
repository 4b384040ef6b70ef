"""Jump of tangents and adjoints at a change of mode (saltation).

At an event h(t, y-) = 0 the state jumps, y+ = R(t, y-), and its rates are F- before and F+ after. A variation Y- of the
state at fixed time, and dp, give

    dt = -(h_y Y- + h_p dp)/(h_y F- + h_t),    Y+ = R_y (Y- + F- dt) + R_t dt + R_p dp - F+ dt

R is the impact (`mbdae.mechanism.discrete_sensitivity.impact_sensitivity`), or 1 where only rows change, followed by
the projection of the run. Switches at known times have dt = 0. The adjoint is the transpose.

Source: M. A. Aizerman, F. R. Gantmacher, Q. J. Mech. Appl. Math. 11 (1958); P. C. Mueller, Chaos, Solitons & Fractals 5
(1995).
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError
from ...mechanism.discrete_sensitivity.guard_partials import GuardPartials
from ...mechanism.discrete_sensitivity.impact_sensitivity import impact_partials, row_rate_partials
from ...mechanism.hybrid.impact import row_impacts
from ...mechanism.hybrid.mode_point import AllRows, ModePoint
from ...mechanism.hybrid.switch import COMMANDS, Guard
from ...mechanism.hybrid.switches import unswitched_rows
from ...system import Array
from ...tolerances import INPUT_DIGITS, RANK, SAME_STATE, VISIBLE
from ..events.guard_location import guard_unit
from ..events.jumps import LATE
from .native_trajectory import NativeStep

if TYPE_CHECKING:
    from .trajectory import Trajectory

LENGTHS = ("contact", "range boundary")  # guards that are lengths or angles


class Jump(NamedTuple):
    """Derivatives of the state after a change of mode.

    Attributes:
        matrix: derivatives of y after the event with respect to (y, p) before it, at fixed time, (ny, ny + k).
        time: derivatives of the time of the event, (ny + k,); 0 at known times.
    """

    matrix: Array
    time: Array

    def tangent(self, dy: Array, dp: Array) -> Array:
        """Return the tangents after the event, (ny, m), given those before it, (ny, m), and of parameters, (k, m)."""
        return np.asarray(self.matrix @ np.concatenate([dy, dp]))

    def adjoint(self, bar: Array) -> tuple[Array, Array]:
        """Return the cotangents of y before, (ny, m), and of parameters, (k, m), given those of y after, (ny, m)."""
        y_bar, p_bar = np.split(self.matrix.T @ bar, [len(bar)])
        return y_bar, p_bar


class ModeJumps:
    """Jumps of the changes of mode of a trajectory.

    Args:
        trajectory: the trajectory.
    """

    def __init__(self, trajectory: "Trajectory") -> None:
        self.trajectory, self.system, self.sensitivity = trajectory, trajectory.system, trajectory.sensitivity
        self.switches = trajectory.system.mechanism.switches
        self.all_rows = AllRows(trajectory.system)
        self.unswitched = unswitched_rows(self.switches, trajectory.system.ng)
        self.first_nodes = [i for i, _ in trajectory.sol.modes]
        self._cache: dict[int, Jump] = {}

    def __getitem__(self, i: int) -> Jump:
        """Return the jump from node i to node i + 1, which have the same time.

        Raises:
            InputError: if it has no derivative: grazing, or simultaneous events; names the switch and the time.
        """
        if i not in self._cache:
            self._cache[i] = self._jump(i)
        return self._cache[i]

    def _jump(self, i: int) -> Jump:
        trajectory, t, ny = self.trajectory, float(self.trajectory.ts[i]), self.sensitivity.ny
        trajectory.enter_node(i)
        before, jumped = trajectory.ys[i], np.eye(ny, ny + self.sensitivity.k + 1)
        if at_known_time := i == 0 or trajectory.ts[i + 1] != t:  # a simulator restarts at its start
            t = float(trajectory.ts[i + 1])
            late = np.inf if i else LATE
            jumped[:, :-1] = self.sensitivity.jump(t, before, late)
            before = self.system.jump(t, before, late)
        point = ModePoint(self.system, self.all_rows, t, before)
        rates, time = np.zeros(ny), np.zeros(ny + self.sensitivity.k)
        if varies := not at_known_time and self._varies(i):
            rates = self._rate_before(i)
            time = self._event(i, point, rates)
        R = self._map(point, jumped)[1]
        if not varies:
            return self.projected(i, Jump(R[:, :-1], time))
        trajectory.enter_node(i + 1)
        after = self.system.derivative(t, trajectory.ys[i + 1])[0]
        change = R[:, :ny] @ rates + R[:, -1] - after
        return self.projected(i, Jump(R[:, :-1] + np.outer(change, time), time))

    def projected(self, i: int, jump: Jump) -> Jump:
        """Return a jump with the projection in the mode after it."""
        if not self.trajectory.project:
            return jump
        trajectory, ny = self.trajectory, self.sensitivity.ny
        trajectory.enter_node(i + 1)
        P = self.sensitivity.projection(float(trajectory.ts[i + 1]), trajectory.ys[i + 1])
        matrix = P[:, :ny] @ jump.matrix
        matrix[:, ny:] += P[:, ny:]
        return jump._replace(matrix=matrix)

    def at_start(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return the point after an impact at the start, in the idle mode, and its partials.

        They are with respect to (y, p), (ny, ny + k).
        """
        self.enter_idle_mode()
        after, R = self.impact(t, y, np.eye(self.sensitivity.ny, self.sensitivity.ny + self.sensitivity.k + 1))
        self.trajectory.enter_node(0)
        return after, R[:, :-1]

    def enter_idle_mode(self) -> None:
        """Enter the idle mode, in which no switch is active, as at a start."""
        self.system.enter((0,) * len(self.system.mode))

    def impact(self, t: float, y: Array, jumped: Array) -> tuple[Array, Array]:
        """Return the point after an impact, and its partials with respect to (y, p, t), from the partials before it."""
        return self._map(ModePoint(self.system, self.all_rows, t, y), jumped)

    def _map(self, point: ModePoint, jumped: Array) -> tuple[Array, Array]:
        """Return the point after the impact, and its partials with respect to (y, p, t), (ny, ny + k + 1)."""
        impacts = row_impacts(point, self.unswitched, self._recent(point.t))
        if not impacts:
            return point.y, jumped
        nv, ny, k = self.system.nv, self.sensitivity.ny, self.sensitivity.k
        velocity_partials = impact_partials(self.sensitivity.parameters, point.t, point.q, impacts)
        out = np.eye(ny, ny + k + 1)
        out[nv : 2 * nv] = 0.0
        out[nv : 2 * nv, np.r_[0 : 2 * nv, ny : ny + k + 1]] = velocity_partials
        kinetic = [self.sensitivity.energy(point.q, v)[0] for v in (point.v, impacts[-1].after)]
        directions = np.vstack([out, np.eye(k, ny + k + 1, ny)])
        out[-1] += kinetic[1] @ directions
        out[-1, :-1] -= kinetic[0]
        R = out[:, :ny] @ jumped
        R[:, ny:] += out[:, ny:]
        nq = self.system.nq
        return np.concatenate([point.y[:nq], impacts[-1].after, point.y[nq + nv :]]), R

    def _recent(self, t: float) -> set[int]:
        """Return the switches with an impact within their rest time before t."""
        last = {name: x.t for x in self.trajectory.sol.impacts if x.t < t for name in x.where}
        return {s.index for s in self.switches if t - last.get(s.name, -np.inf) < s.rest}

    def _rate_before(self, i: int) -> Array:
        """Return F-, (ny,): the derivative of the end of the last step with respect to its size, y' to the local error.

        Friction whose sign changes with the normal force within the step has kinks, which do not affect y' at its end.
        """
        ny, k = self.sensitivity.ny, self.sensitivity.k
        zeros = np.zeros((ny, 1)), np.zeros((self.trajectory.n_carry, 1)), np.zeros((k, 1))
        rate = NativeStep(self.trajectory.core, i - 1).forward(*zeros, np.ones(1))[0][:, 0]
        self.trajectory.enter_node(i)
        return rate

    def _event(self, i: int, point: ModePoint, rates: Array) -> Array:
        """Return the derivatives of the time at which a guard ends a mode with respect to (y, p), (ny + k,).

        Raises:
            InputError: for grazing and for simultaneous events of different derivatives.
        """
        times = self._times(i, point, rates)
        events = [(name, x) for name, x in times if len(x)]
        if not events:
            name = next((name for name, _ in times), self.switches[0].name)
            raise InputError(f"{name!r} only grazes its limit at t = {point.t:.9g} s: the run is not differentiable")
        self._require_one_time(point, events)
        return events[0][1]

    def _times(self, i: int, point: ModePoint, rates: Array) -> list[tuple[str, Array]]:
        """Return the guards that are zero at node i, and the derivatives of their times (ny + k,); empty if grazing."""
        m = max(k for k in self.first_nodes if k <= i)
        first = ModePoint(self.system, self.all_rows, float(self.trajectory.ts[m]), self.trajectory.ys[m])
        mode = self.system.mode
        guards = [g for s in self.switches for g in s.guards(mode[s.index]) if g.kind not in COMMANDS]
        for g in guards:
            g.value(first)
        partials = GuardPartials(self.sensitivity, first, point)
        times = ((g.name, self._time(g, i, partials, rates)) for g in guards)
        return [(name, x) for name, x in times if x is not None]

    def _time(self, guard: Guard, i: int, partials: GuardPartials, rates: Array) -> Array | None:
        """Return the derivatives of the time at which a guard falls below zero, (ny + k,); None if it does not."""
        gradient, point, trajectory = partials.gradient(guard), partials.point, self.trajectory
        terms = np.append(gradient[: self.sensitivity.ny] * rates, gradient[-1])
        total, size = float(terms.sum()), float(np.abs(terms).sum())
        tolerance = SAME_STATE * float(trajectory.ts[i] - trajectory.ts[i - 1]) + trajectory.sol.jump_margin
        if abs(guard.value(point)) > tolerance * size:
            return None
        if guard.kind in LENGTHS:  # a characteristic speed, since all speeds may be small
            size = max(size, guard_unit(guard, point) * self.system.mechanism.characteristic_rate)
        if abs(total) <= VISIBLE * size:
            return np.empty(0)
        return -gradient[:-1] / total if total < 0 else None

    def _varies(self, i: int) -> bool:
        """Return whether the time of a change of mode varies: not at the start, or just after a jump at a known time.

        Raises:
            InputError: just after an event, whose time varies.
        """
        first = i
        while first > 0 and self.trajectory.jumped[first - 1]:
            first -= 1
        if first == i:
            return i > 0
        if first > 0 and self.trajectory.ts[first] == self.trajectory.ts[first + 1]:
            when = f"t = {self.trajectory.ts[i]:.9g} s"
            raise InputError(f"the mode changes twice at {when}: the run is not differentiable")
        return False

    def _require_one_time(self, point: ModePoint, events: list[tuple[str, Array]]) -> None:
        """Check that simultaneous events remain simultaneous: the derivatives of their times agree.

        Raises:
            InputError: if their order depends on the variation; names the switches.
        """
        if len(events) < 2:
            return
        nv, ny = self.system.nv, self.sensitivity.ny
        g, rate = row_rate_partials(self.sensitivity.parameters, point.t, point.q, point.v)
        active = np.setdiff1d(np.arange(self.system.ng), self.system.constraints.inactive)
        rows = np.vstack([g[active][self.system.constraints.positional[active]], rate[active]])[:, :-1]
        _, sizes, right = np.linalg.svd(rows)
        free = right[int(np.count_nonzero(sizes > RANK * sizes.max(initial=0.0))) :]
        times = [x[np.r_[0 : 2 * nv, ny : len(x)]] @ free.T for _, x in events]
        if any(np.abs(x - times[0]).max() > INPUT_DIGITS * np.abs(times[0]).max() for x in times[1:]):
            names = " and ".join(repr(name) for name, _ in events)
            why = "the run is not differentiable, since perturbations change their order"
            raise InputError(f"{names} switch at the same time, t = {point.t:.9g} s: {why}")
