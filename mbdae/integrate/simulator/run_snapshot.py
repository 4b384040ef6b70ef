"""Snapshots: all data from which a run, or a simulator, continues with bitwise equal results."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.fmu.session import saved_states
from ...mechanism.time_functions.input_functions import InputSetting
from ...system import Array, State
from ..events.jumps import SmoothInterval
from ..options.options import RunOptions
from ..run.run_setup import prepare_at
from ..run.run_state import RunState
from ..steppers.stepper import StepperState


class RunSnapshot(NamedTuple):
    """All data from which a run continues.

    Attributes:
        t: time in s.
        y: the point (n,).
        carry: the carry of the method; None if it is recomputed.
        compensation: see `mbdae.system.State`.
        rows: the rows in use; None if all are independent.
        rank_threshold: pivot ratio below which the constraints count as rank deficient.
        mode: mode of the mechanism.
        stepper: state of the step-size control.
        interval: the smooth interval, if a jump follows at t; None within one.
        initial_point: the point at the start of the run, before controllers were sampled.
    """

    t: float
    y: Array
    carry: Array | None
    compensation: Array | None
    rows: tuple[int, ...] | None
    rank_threshold: float
    mode: tuple[int, ...]
    stepper: StepperState
    interval: SmoothInterval | None
    initial_point: Array


class Origin(NamedTuple):
    """Simulator of a saved state: title of the mechanism, method, formulation, and fixed step in s."""

    mechanism: str
    method: str
    formulation: str
    step: float | None


@dataclass(frozen=True)
class SimulatorState:
    """All data from which a simulator continues; can be pickled.

    Attributes:
        run: time, state, rows in use, mode and step-size control.
        inputs: the setting of each input, by name.
        pending: inputs that were set, by name, since the last communication step.
        start: time in s from which fixed steps are counted.
        origin: the simulator that saved it.
        fresh: whether no step has been taken since the start.
        external: the states of FMUs, by the names of their forces.
    """

    run: RunSnapshot
    inputs: dict[str, InputSetting]
    pending: dict[str, float]
    start: float
    origin: Origin
    fresh: bool
    external: dict[str, bytes | None]

    def require_external(self) -> None:
        """Check that the states of all FMUs are available.

        Raises:
            InputError: if an FMU cannot save its state; names the FMU.
        """
        for name, state in self.external.items():
            if state is None:
                raise InputError(f"FMU {name!r} cannot save its state: it lacks canSerializeFMUState")

    def require_for(self, mechanism: Mechanism, inputs: Collection[str], origin: Origin) -> None:
        """Check that the state belongs to this mechanism, method and fixed step.

        Raises:
            InputError: if it does not.
        """
        n = mechanism.nq + mechanism.nv + len(mechanism.states) + 1
        if self.run.y.shape != (n,) or set(self.inputs) != set(inputs) or len(self.run.mode) != len(mechanism.switches):
            raise InputError(f"the state was saved by a simulator of another mechanism, not of {mechanism.title}")
        if self.origin != origin:
            pairs = zip(Origin._fields, self.origin, origin, strict=True)
            differences = [f"{name} {a!r}, not {b!r}" for name, a, b in pairs if a != b]
            raise InputError(f"the state was saved by a simulator of {', '.join(differences)}")
        if not np.isfinite(self.run.y).all():
            raise InputError("the saved state is not finite")


def external_states(run: RunState) -> dict[str, bytes | None]:
    """Return the states of FMUs at the last node of a run."""
    s: Any = run.system
    states: dict[str, bytes | None] = s.laws.external_states(s.element_states(run.ys[-1]))
    return states


def prepare_restored(run: RunState, options: RunOptions, state: SimulatorState) -> RunState:
    """Return a run that can begin at a state; it replaces a run of the same mechanism, and adopts its FMUs."""
    saved_states.store({name: x for name, x in state.external.items() if x})
    previous: Any = run.system
    programs, t = previous.laws.detach_programs(), state.run.t
    run.release()
    out = prepare_at(run.problem, options._replace(t0=t, t1=t + 1, end=t + 1), state.run.y)
    system: Any = out.system
    system.laws.attach_programs(programs)
    return out


def snapshot(run: RunState) -> RunSnapshot:
    """Return the snapshot of a run of a mechanism at its last node."""
    s: Any = run.system
    carry = run.state.carry if isinstance(run.state.carry, np.ndarray) else None
    rows = None if s.rows is None else tuple(s.rows.tolist())
    y, compensation = run.ys[-1].copy(), run.state.compensation
    interval = run.interval if run.interval.leaves_jump(run.t) else None
    stepper = run.stepper.snapshot()
    system_state = rows, s.rank_threshold, s.mode
    return RunSnapshot(run.t, y, carry, compensation, *system_state, stepper, interval, run.initial_point)


def resume(run: RunState, start: RunSnapshot) -> None:
    """Begin a new run at a snapshot, in place of `RunState.begin`."""
    s: Any = run.system
    t, y, carry, compensation, rows, s.rank_threshold, mode, stepper, interval, run.initial_point = start
    run.ys[-1] = y
    s.laws.set_inputs(s.element_states(y))
    if run.mode_changes:
        run.mode_changes.resume(run, mode)
    if rows is not None:
        s.use_rows(rows)
    run.record_rows()
    run.F, run.zs[-1] = s.derivative(t, y)
    run.state = State(y, s.carry(run.F, run.zs[-1]) if carry is None else carry, compensation)
    run.carries.store(0, run.state.carry)
    run.interval = interval or run.jumps.interval(t)
    run.stepper.resume(stepper)
    for source in run.sources:
        source.begin_interval(run)
