"""Jumps of tangents and adjoints at user-defined events: h and R of an event in `mbdae.integrate.trajectory.jump`."""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...mechanism.hybrid.reset import Reset, ResetMap
from ...system import Array
from ...tolerances import VISIBLE
from ..events.level_crossing import parse_level_crossing
from .jump import Jump
from .signal_jacobian import SignalJacobian

if TYPE_CHECKING:
    from .trajectory import Trajectory


class ResetJumps:
    """Jumps of the events of a trajectory.

    Args:
        trajectory: trajectory of a run.
    """

    def __init__(self, trajectory: "Trajectory") -> None:
        self.trajectory = trajectory
        self.resets = {reset.name: reset for reset in trajectory.system.mechanism.resets}
        self.names = {i - 1: name for i, name in trajectory.sol.resets}  # by the last node before each jump

    def __contains__(self, i: int) -> bool:
        """Return whether an event leads from node i to node i + 1."""
        return i in self.names

    def __getitem__(self, i: int) -> Jump:
        """Return the jump from node i to node i + 1, which have the same time.

        Raises:
            InputError: for grazing, and for signals without derivatives; names the event and the time.
        """
        trajectory, reset, sensitivity = self.trajectory, self.resets[self.names[i]], self.trajectory.sensitivity
        t, y, ny = float(trajectory.ts[i]), trajectory.ys[i], sensitivity.ny
        if i and trajectory.jumped[i - 1]:
            when = f"coincides with another event at t = {t:.9g} s"
            raise InputError(f"event {reset.name!r} {when}: the run is not differentiable")
        trajectory.enter_node(i)
        before = trajectory.system.derivative(t, y)[0]
        gradient = SignalJacobian(trajectory, [parse_level_crossing(reset.signal).signal]).rows(i, t, y)[0]
        total = float(gradient[:ny] @ before + gradient[-1])
        if abs(total) <= VISIBLE * float(np.abs(gradient[:ny] * before).sum() + abs(gradient[-1])):
            when = f"only grazes its level at t = {t:.9g} s"
            raise InputError(f"event {reset.name!r} {when}: the run is not differentiable")
        reset_map = ResetMap(trajectory.system, reset)
        for k, (p, perturbed) in enumerate(
            zip(sensitivity.parameters.all, reset_map.perturbed_resets(sensitivity), strict=True)
        ):
            gradient[ny + k] -= p.quotient({j: np.array(_level(x)) for j, x in perturbed.items()})
        switched = bool(trajectory.system.mechanism.switches)
        R = self._map(reset_map, t, y) if switched else reset_map.partials(sensitivity, t, y)
        trajectory.enter_node(i + 1)
        after = trajectory.system.derivative(float(trajectory.ts[i + 1]), trajectory.ys[i + 1])[0]
        time = -gradient[:-1] / total
        jump = Jump(R[:, :-1] + np.outer(R[:, :ny] @ before + R[:, -1] - after, time), time)
        return trajectory.jumps.projected(i, jump) if switched else jump

    def _map(self, reset: ResetMap, t: float, y: Array) -> Array:
        """Return the derivatives of y after the event and its impacts with respect to (y, p, t), (ny, ny + k + 1)."""
        trajectory, sensitivity = self.trajectory, self.trajectory.sensitivity
        trajectory.jumps.enter_idle_mode()
        after, R = trajectory.jumps.impact(t, reset.assembled(t, y), reset.assembled_partials(sensitivity, t, y))
        return reset.with_work_partials(sensitivity, y, after, R)


def _level(reset: Reset) -> float:
    return parse_level_crossing(reset.signal).level
