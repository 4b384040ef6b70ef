"""Dense output: a solution between the ends of its steps."""

from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, Self, cast

import numpy as np

from ..arguments import as_numbers
from ..errors import InputError, StepError
from ..mechanism import Mechanism
from ..system import Array
from ..tolerances import JUMP_MARGIN, NEGLIGIBLE
from .sampling import sample_together, set_slip_directions

# multiple of the spacing of t: nodes at a jump are closer, and q is the same; far from t = 0 steps may be as short
JUMP_DISTANCE = 6 * JUMP_MARGIN


class DenseOutput:
    """Points, rates and multipliers of a solution at any time of a run."""

    t: Array
    y: Array
    z_own: Array
    steps: tuple[Array, Array, Array] | None
    in_use: list[tuple[int, tuple[int, ...]]]
    modes: list[tuple[int, tuple[int, ...]]]
    settings: dict[str, Any]
    system: Any
    problem: Any

    def __init__(self) -> None:
        self.rates: dict[int, Array] = {}
        self.integrals: dict[str, Any] = {}
        self._dense: dict[int, Callable[[float], Array]] = {}

    @property
    def nodes(self) -> tuple[Array, Array, Array]:
        """Times, points and the method's multipliers at the start of the run and the ends of all steps."""
        return self.steps or (self.t, self.y, self.z_own)

    def at(self, i: int) -> Any:
        """Return the workspace in the mode and with the rows in use at node i, on which its results depend."""
        return self.prepared(self.system, i)

    def prepared(self, system: Any, i: int, frozen: bool = True) -> Any:
        """Return a workspace of any formulation in the mode and with the rows in use at node i.

        Args:
            system: the workspace.
            i: the node.
            frozen: see `mbdae.system.System.use_rows`.
        """
        rows = next((rows for first, rows in reversed(self.in_use) if first <= i), None)
        if self.modes:
            system.enter(self.mode(i))
        if rows and (not system.rows_frozen or rows != system.in_use):
            system.use_rows(rows, frozen)
        if self.modes and system.closure_friction.can_stick:
            set_slip_directions(system, self._from_node(i))
        return system

    def _from_node(self, i: int) -> Iterator[Array]:
        """Yield the points in the mode of node i: those from this node on, then those before it, backward in time."""
        starts = [first for first, _ in self.modes]
        k, ys = bisect_right(starts, i), self.nodes[1]
        yield from ys[i : starts[k] if k < len(starts) else None]
        yield from ys[starts[k - 1] : i][::-1]

    def mode(self, i: int) -> tuple[int, ...]:
        """Return the states of the mechanism's switches at node i."""
        return next((mode for first, mode in reversed(self.modes) if first <= i), ())

    def before(self, t: Array) -> Array:
        """Return the node at or before each time, (k,); of the two nodes at a jump, the second."""
        ts = np.asarray(self.nodes[0])
        sign = 1.0 if len(ts) < 2 or ts[-1] > ts[0] else -1.0
        return np.clip(np.searchsorted(sign * ts, sign * np.asarray(t), side="right") - 1, 0, max(0, len(ts) - 1))

    @property
    def jump_margin(self) -> float:
        """Largest time between the two nodes of a jump: roundings of the time span, even if a run ends early."""
        ts, span = self.nodes[0], self.settings.get("t_span", ())
        return JUMP_DISTANCE * float(np.spacing(max(*np.abs([ts[0], ts[-1], *span]), NEGLIGIBLE)))

    def jumped(self, first: int = 0, last: int | None = None) -> Array:
        """Return whether nodes i and i + 1 are those of a jump, at which q is constant, for a range of i."""
        nodes = slice(first, last)
        ts, ys = np.asarray(self.nodes[0][nodes]), self.nodes[1][nodes]
        q = ys[:, : self.problem.nq] if isinstance(self.problem, Mechanism) else ys
        gap = np.abs(np.diff(ts))
        return (gap == 0) | (gap <= self.jump_margin) & (q[1:] == q[:-1]).all(axis=1)

    def point(self, t: float) -> Array:
        """Return y at any time of the run, interpolated within steps; between the two nodes of a jump, y before it.

        Raises:
            InputError: for a time outside.
        """
        return next(self._one_by_one(np.array([t], float)))

    def points(self, times: Array) -> Iterator[Array]:
        """Yield y at several times of the run; computed together if possible.

        Raises:
            InputError: for a time outside.
            StepError: for a point that cannot be computed, after the points before it.
        """
        sampled, times = None, np.asarray(times, float)
        with suppress(StepError):
            sampled = sample_together(self, times)
        yield from self._one_by_one(times) if sampled is None else sampled

    def _one_by_one(self, times: Array) -> Iterator[Array]:
        """Yield y at each time; the steps of all times are located together."""
        if not len(times):
            return
        ts, ys, _ = self.nodes
        low, high = min(ts[0], ts[-1]), max(ts[0], ts[-1])
        if len(outside := times[~((low <= times) & (times <= high))]):
            raise InputError(f"t = {float(outside[0])} is outside the solution, {low} to {high}")
        if len(ts) == 1:
            yield from ys[np.zeros(len(times), int)]
            return
        steps = np.minimum(self.before(times), len(ts) - 2)
        first = int(steps.min())
        jumped = self.jumped(first, int(steps.max()) + 2)[steps - first]
        for t, i, jump in zip(times.tolist(), steps.tolist(), jumped.tolist(), strict=True):
            if t == ts[i + 1]:
                yield ys[i + 1]
            elif t == ts[i] or jump:
                yield ys[i]
            else:
                yield self.dense(i)((t - ts[i]) / (ts[i + 1] - ts[i]))

    def dense(self, i: int) -> Callable[[float], Array]:
        """Return theta -> y on step i, theta in [0, 1]; its order is one below the order of the method."""
        if i not in self._dense:
            ts, ys, _ = self.nodes
            rates = self.rate(i), self.rate(i + 1)
            order = self.settings["dense_order"]
            interpolant = self.at(i).interpolant(ts[i], ts[i + 1] - ts[i], (ys[i], ys[i + 1]), rates, order)
            self._dense[i] = partial(self._on_step, i, interpolant)
        return self._dense[i]

    def _on_step(self, i: int, interpolant: Callable[[float], Array], theta: float) -> Array:
        self.at(i)  # the interpolant may use the workspace later
        return interpolant(theta)

    def rate(self, i: int) -> Array:
        """Return y' (ny,) at node i, computed once."""
        if i not in self.rates:
            ts, ys, zs = self.nodes
            self.rates[i] = self.at(i).derivative(ts[i], ys[i], zs[i])[0]
        return self.rates[i]

    def multipliers(self, t: float | Array) -> Array:
        """Return z (nz,) at a time of the run, or (n, nz) at several, from the hidden constraint; the first ng are lam.

        Raises:
            InputError: for a time outside.
        """
        times = as_numbers(t)
        z = cast(Any, self.resampled(times.ravel())).z
        return z.reshape(*times.shape, z.shape[1])

    def resampled(self, times: Array) -> Self:
        """Return the solution at other times (m,) within its span, by dense output.

        The multipliers of the method are those at the start of each step.

        Raises:
            InputError: for a time outside, or anything other than an array of times.
        """
        times = as_numbers(times)
        if times.ndim != 1:
            raise InputError(f"times have the shape (m,), got {times.shape}")
        points = np.array(list(self.points(times))).reshape(len(times), self.y.shape[1])
        return self._view(times, points, self.nodes[2][self.before(times)], self.nodes)

    def at_nodes(self) -> Self:
        """Return the solution at the ends of all steps, independent of ``t_eval``."""
        return self if self.steps is None else self._view(*self.steps, None)

    def _view(self, t: Array, y: Array, z_own: Array, steps: tuple[Array, Array, Array] | None) -> Self:
        """Return the same run at other times; workspace, rates at the nodes and integrals are shared."""
        view: Any = replace(cast(Any, self), t=np.asarray(t), y=np.asarray(y), z_own=np.asarray(z_own), steps=steps)
        view.__dict__["system"], view.rates, view.integrals = self.system, self.rates, self.integrals
        return view
