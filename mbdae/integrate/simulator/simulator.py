"""Simulation in communication steps, between which a controller, a user interface or another program may set inputs."""

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from ...errors import STATUS, InputError, StepError, is_number, require
from ...mechanism import Mechanism, ModelSource
from ...mechanism.inputs import Inputs
from ...solution.problem import problem_of
from ...solution.signal_value import find_point_signal, value
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import COINCIDENT
from ..options.options import RunOptions
from ..options.span import end_of_tables
from ..run.loop import time_loop
from ..run.result import joined, make_solution
from ..run.run_setup import prepare
from ..run.run_state import RunState
from ..steppers.fixed import Fixed
from .communication_step_sensitivity import LastCommunicationStep
from .differentiable_simulator import DifferentiableSimulator
from .input_settings import InputSettings
from .run_snapshot import Origin, SimulatorState, external_states, prepare_restored, resume, snapshot

UNLIMITED = 2**31 - 1  # number of fixed steps
MAX_NODES = 4096  # nodes after which a simulator without a record begins a new run


class Simulator(DifferentiableSimulator):
    """A mechanism that is advanced step by step, with inputs that may change between the steps.

        q' = v,   M(q) v' = f(t, q, v, s, u) + G(q)^T lam,   0 = G(q) v + g_t,   u(t) = u_k or u_k + u_k' (t - t_k)

    With constant inputs and fixed steps the states are bitwise equal to those of `mbdae.solve`. Where an input jumps,
    the method restarts, as at jumps of functions of time. A simulator must not be shared between threads.

    Args:
        model: a mechanism, or the name or path of one.
        t: start time in s.
        q: consistent start configuration (nq,); the model's start if omitted.
        v: consistent start velocity (nv,); the model's start if omitted.
        s: start values (ns,) of states of actuators and controllers; their defaults if omitted.
        record: whether to keep all steps for `solution`; otherwise memory does not grow.
        restart: whether each communication step restarts a method that carries v' between steps, as after a jump. Then
            its end depends only on the state at its start, inputs and parameters, for `tangent` and `adjoint`.
        **options: options of `mbdae.solve`: method, formulation, project, baumgarte, step (fixed; controlled if
            omitted), rtol, atol, first_step, max_step, jumps, events, backend.

    Attributes:
        mechanism: a copy whose inputs belong to this simulator.
        status: ``"running"``; ``"event"`` if a terminal event ended the last step; otherwise why it has stopped.
        message: description of the status.

    Raises:
        InputError: for wrong arguments, or an inconsistent start.
        UnknownNameError: for an unknown method.

    Example:
        >>> simulator = mbdae.Simulator("slider_crank", step=1e-3)
        >>> simulator.advance(0.1)
        'running'
    """

    def __init__(
        self,
        model: Mechanism | ModelSource,
        t: float = 0.0,
        q: Array | None = None,
        v: Array | None = None,
        s: Array | None = None,
        *,
        record: bool = True,
        restart: bool = False,
        jumps: Sequence[float] = (),
        events: Any = None,
        backend: str = "auto",
        **options: Any,
    ) -> None:
        problem = problem_of(model, "Simulator")
        if not isinstance(problem, Mechanism):
            raise InputError("a simulator needs a mechanism; textbook problems are solved by mbdae.solve")
        if excluded := options.keys() & {"t_span", "t_eval", "max_steps", "progress"}:
            raise InputError(f"a simulator takes no {min(excluded)}: it starts at t, and advance() steps it")
        if not is_number(t):
            raise InputError(f"t must be a finite number, got {t!r:.60}")
        self.inputs = Inputs(problem)
        self.mechanism = self.inputs.mechanism
        span = t, np.nextafter(t, np.inf) + 1.0
        run_options = RunOptions.from_arguments(self.mechanism, span, None, jumps, events, backend, **options)
        self.options = run_options._replace(max_steps=None)  # the limit of the mechanism file applies to runs
        self.recorded, self.restart, self.start, self.seconds = record, restart, float(t), 0.0
        self.status, self.message = "running", STATUS["finished"]
        self._settings = InputSettings(self.inputs)
        # recorded before the last save; no step yet since a start at which the carry was computed
        self._earlier, self._fresh = list[Solution](), True
        self._continue(prepare(self.inputs.begin(s), self.options, (q, v, s)))
        with np.errstate(over="ignore", invalid="ignore"):
            self._run.begin()

    def _continue(self, run: RunState) -> None:
        """Continue with a run, whose fixed steps are counted from the start of the simulator."""
        self._current, run.continues = run, True
        if isinstance(fixed := getattr(run.stepper, "inner", run.stepper), Fixed):
            fixed.n, fixed.t0 = UNLIMITED, self.start

    @property
    def _run(self) -> RunState:
        """The run, after all its steps are recorded."""
        self._current.stepper.record(self._current)
        return self._current

    @property
    def _y(self) -> Array:
        """The current point (n,)."""
        return self._current.stepper.point(self._current)

    def __repr__(self) -> str:
        return f"<Simulator of {self.mechanism.title} at t = {self.t:.9g} s: {self.status}>"

    @property
    def t(self) -> float:
        """Time in s."""
        return self._current.stepper.time(self._current)

    @property
    def q(self) -> Array:
        """Configuration (nq,)."""
        return self._y[: self.mechanism.nq].copy()

    @property
    def v(self) -> Array:
        """Velocity (nv,)."""
        nq = self.mechanism.nq
        return self._y[nq : nq + self.mechanism.nv].copy()

    @property
    def s(self) -> Array:
        """States of actuators and controllers (ns,)."""
        return self._y[self.mechanism.nq + self.mechanism.nv : -1].copy()

    @property
    def mode(self) -> tuple[int, ...]:
        """The state of each switch of ``mechanism.switches``."""
        return self._current.system.mode  # type: ignore[attr-defined]

    def signals(self, *names: str) -> Array:
        """Return current values of signals, (len(names),), by the names of `mbdae.Solution.signals`.

        Raises:
            UnknownNameError: for an unknown name.
        """
        system: Any = self._current.system
        t, y = self.t, self._y
        return np.array([value(system, find_point_signal(self.mechanism, name), t, y) for name in names])

    def __getitem__(self, name: str) -> float:
        """Return the current value of an input.

        Raises:
            UnknownNameError: lists the inputs.
        """
        return self._settings.value(name, self.t)

    def __setitem__(self, name: str, value: float) -> None:
        """Set an input: from now on, or, with ``hold = "first"``, at the end of the next communication step.

        Raises:
            UnknownNameError: lists the inputs.
            InputError: for a value that is not a finite number.
        """
        self._require_running()
        self._settings.set(name, value)

    def advance(self, dt: float) -> str:
        """Advance by a step dt in s; return ``"running"``, or ``"event"`` if a terminal event ended the step early.

        Raises:
            InputError: for a dt that is not positive, or a simulator that has stopped.
            StepError: if the steps fail; the simulator then has stopped, and its steps up to the failure remain.
        """
        self._require_running()
        if not (is_number(dt) and dt > 0):
            raise InputError(f"dt must be a positive number in s, got {dt!r:.60}")
        if not self.recorded and self._current.stepper.node_count(self._current) > MAX_NODES:
            self._begin_new_run()
        self._last = self._differentiated = None
        started, t0, node = perf_counter(), self.t, self._current.stepper.node_count(self._current) - 1
        target = self._on_grid(t0 + dt)
        end = end_of_tables(self.mechanism.drivers, t0, target)
        try:
            restarts, stopped = self._apply_inputs(dt), False
            if restarts or not self._current.stepper.continue_unrecorded(self._current, end):
                with np.errstate(over="ignore", invalid="ignore"):
                    restarts, stopped = self._loop(end, restarts)
        except StepError as e:
            for source in self._current.sources:
                e = source.explain(self._current, e)
            self.status, self.message = e.status, str(e)
            raise e from None
        finally:
            self.seconds += perf_counter() - started
        if end < target:
            self.status = "driver"
            self.message = next(text for d in self.mechanism.drivers if (text := d.outside(target)))
            raise StepError(self.status, self.message)
        self._last = LastCommunicationStep(node, t0, restarts or self._fresh, self.t - t0)
        self.status, self._fresh = "event" if stopped else "running", False
        return self.status

    def _apply_inputs(self, dt: float) -> bool:
        """Apply the inputs that were set, over dt; return whether the method restarts."""
        carries = getattr(self._current.tableau, "carries", False)
        return self._settings.apply(self.t, dt) | (self.restart and carries and not self._fresh)

    def _loop(self, end: float, restarts: bool) -> tuple[bool, bool]:
        """Step to the end in the time loop; return whether the method restarted, and whether an event stopped it."""
        run = self._run
        restarts |= (jumps := run.interval.leaves_jump(run.t))
        if restarts and self._fresh:  # controllers are sampled again at the start, with the inputs that were set
            run.ys[-1], jumps = run.point_before_sampling(), True
        if restarts:
            run.restart_after_jump(run.t, len(run.ts) > 1 or bool(self._earlier), jumps)
        run.continue_to(end)
        return restarts, time_loop(run)

    def _on_grid(self, t: float) -> float:
        """Return the time, replaced by that of a fixed step if they differ only by rounding."""
        if not (h := self.options.step):
            return t
        on_grid = self.start + round((t - self.start) / h) * h
        return on_grid if abs(on_grid - t) <= COINCIDENT * h else t

    def _require_running(self) -> None:
        if self.status not in ("running", "event"):
            raise InputError(f"the simulator stopped at t = {self.t:.9g} s ({self.status}): {self.message}")

    # -- saving and results --------------------------------------------------------------------------------------

    def save(self) -> SimulatorState:
        """Return the state, from which `restore` continues bitwise like this simulator after this call.

        Starting values of Newton's iteration are not saved: both continue without them. A simulator without a record
        discards the steps so far.

        Raises:
            InputError: for a simulator that has stopped, or with an FMU that cannot save its state.
        """
        state = self._begin_new_run()
        state.require_external()
        return state

    def _begin_new_run(self) -> SimulatorState:
        """Return the state, and begin a new run at this state."""
        self._require_running()
        settings, run = self._settings, self._run
        data = snapshot(run), self.inputs.values, dict(settings.pending), self.start, self._origin, self._fresh
        state = SimulatorState(*data, external_states(run))
        earlier = [*self._earlier, self._solution_of_run()] if self.recorded else []
        self.restore(state)
        if self.recorded:
            self._earlier, self._settings = earlier, settings
        return state

    def restore(self, state: SimulatorState) -> None:
        """Continue from a saved state, of this simulator or of another one with the same mechanism and options.

        A new record begins.

        Raises:
            InputError: for any other argument.
        """
        require(state, SimulatorState, "restore takes a state from save")
        state.require_for(self.mechanism, self.inputs.user_inputs, self._origin)
        for name, setting in state.inputs.items():
            self.inputs.user_input(name).set(setting)
        self.start, self._settings, self._earlier = state.start, InputSettings(self.inputs, state.pending), []
        self.status, self.message = "running", STATUS["finished"]
        self._last, self._differentiated, self._fresh = None, None, state.fresh
        self._continue(prepare_restored(self._run, self.options, state))
        resume(self._run, state.run)

    @property
    def _origin(self) -> Origin:
        o = self.options
        return Origin(self.mechanism.title, str(o.method.name), o.formulation, o.step)

    def _solution_of_run(self) -> Solution:
        status = "finished" if self.status in ("running", "event") else self.status
        return make_solution(self._run, self.mechanism, status, self.message, self.seconds)

    def solution(self) -> Solution:
        """Return the recorded steps as a solution of `mbdae.solve`; inputs are functions of time with their history."""
        out = joined([*self._earlier, self._solution_of_run()])
        return replace(out, problem=self.inputs.recorded(out.t, out.y, self._settings.history))
