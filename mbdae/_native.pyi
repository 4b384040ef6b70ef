"""The compiled core for type checkers; tests/native_stub.py writes this file. Fields: native/*/*.hpp."""

from collections.abc import Sequence
from typing import Any, overload

import numpy as np

Array = np.ndarray

def version() -> str: ...
def sweeps(model: Any) -> bool: ...
def tree_data(model: Any) -> Any: ...
def point_paths(model: Any, joints: Sequence[int], points: Array, q: Array) -> Array: ...

class UnknownKind(ValueError):
    pass

class Tolerances:
    def __init__(
        self,
        *,
        eps: float,
        tiny: float,
        below_rounding: float,
        rounding: float,
        sum_rounding: float,
        evaluation_rounding: float,
        solution_rounding: float,
        search_tolerance: float,
        same_state: float,
        zero_speed: float,
        pivot_rank: float,
        truncation: float,
        visible: float,
        max_rotation: float,
        series: Array,
        smallest_pivot: float,
        worst_conditioning: float,
        growth_tolerance: float,
        reselection_ratio: float,
        probe_tolerance: float,
        cg_tolerance: float,
        many_rows: int,
        extra_cg_iterations: int,
        projection_max_remaining: float,
        projection_open: float,
        projection_stalled: float,
        projection_iterations: int,
        ggl_iterations: int,
        friction_iterations: int,
        slip_cosine: float,
        clear_slip: float,
        stage_iterations: int,
        row_scales: Array,
        q_scales: Array,
        coordinate_scales: Array,
    ) -> None: ...

class Tableau:
    def __init__(
        self,
        *,
        A: Array,
        Ahat: Array,
        b: Array,
        c: Array,
        chat: Array,
        error_weights: Array,
        explicit_first: bool,
        project_embedded: bool,
        doubling_order: int,
        noise: float,
    ) -> None: ...

class StageMemory:
    pass

class EigenMode:
    def __init__(self, *, value: complex, column: Sequence[complex], row: Sequence[complex]) -> None: ...

class Radau:
    def __init__(
        self,
        *,
        c: Array,
        A: Array,
        modes: Sequence[EigenMode],
        real: int,
        gamma: float,
        start: Array,
        middle: int,
        max_iterations: int,
        max_iterations_controlled: int,
        extra_iterations: int,
        first_iterations: int,
        below_rounding: float,
        iteration_rounding: float,
        negligible: float,
        expected_rate: float,
        reuse: float,
    ) -> None: ...

class NewtonIteration:
    def __init__(
        self, *, max_iterations: int, below_rounding: float, iteration_rounding: float, slowest_rate: float
    ) -> None: ...

class Composition:
    def __init__(self, *, weights: Array, nodes: Array, iteration: NewtonIteration) -> None: ...

class GeneralizedAlpha:
    def __init__(
        self, *, alpha_m: float, alpha_f: float, beta: float, gamma: float, stabilized: bool, iteration: NewtonIteration
    ) -> None: ...

class SmoothInterval:
    t: float
    sign: float
    stop: float
    end: float
    t1: float

class StepControl:
    h: float
    uncut_size: float
    last: float
    rejected: bool
    largest: float
    rtol: float
    atol: list[float]
    tiny: float
    companion: float
    blend: float
    power: float
    exponent: float
    last_exponent: float
    safety: float
    smallest_factor: float
    largest_factor: float
    min_growth: float
    smallest_error: float
    smallest_last: float
    agreement: float
    spacings: float

class Grid:
    i: int
    on_grid: bool
    step: float
    t0: float
    n: int
    coincident: float

class SingularityMonitor:
    largest_ratio: float
    last_ratio: float
    mode_ratio: float
    suspicious_ratio: float
    singular_ratio: float
    monitored_ratio: float
    notch_ratio: float
    small_ratio: float
    adjacent_ratio: float
    max_change: float
    steps_ahead: float
    near_singular: bool
    suspicious: bool
    by_mode: bool
    ratio_by_mode: list[tuple[list[int], float]]

class FirstStep:
    def __init__(
        self,
        *,
        sign: float,
        left: float,
        rtol: float,
        atol: Array,
        power: float,
        small_norm: float,
        default_step: float,
        reduction: float,
        change: float,
        growth: float,
        zero_change: float,
        tiny: float,
    ) -> None: ...

class ParameterLocation:
    def __init__(self, *, kind: str, of: int, i: int) -> None: ...

class RunStart:
    def __init__(self, *, ambiguous: float, fallen: float, dependent: float, shortest: float, longest: int) -> None: ...

class Jumps:
    in_core: bool
    times: list[float]
    margin: float
    max_cluster: int
    restart: float

class Events:
    stopped: bool
    start: float
    agreement: float
    spacings: float
    step_tolerance: float
    iterations: int
    def set_events(self, events: list) -> None: ...
    def set_nodes(self, nodes: Sequence[tuple[float, float, float]]) -> None: ...
    @property
    def nodes(self) -> list[tuple[float, float, float]]: ...
    def located(self) -> list[tuple[int, float, Array]]: ...

class Modes:
    in_core: bool
    undecided: bool
    mode: list[int]
    last_impact: list[float]
    unswitched: list[int]
    characteristic_rate: float
    mode_rounding: float
    return_factor: float
    start_root: float
    grazing: float
    spacings: float
    step_tolerance: float
    iterations: int
    root_iterations: int
    max_halvings: int
    rough: float
    near_limit: float
    close_extremum: float
    outside: float
    finest: int
    safety: float
    shrink: float
    shortest: float
    coincident: float
    transverse: float
    at_limit: float
    lookahead: float
    ambiguous: float
    fallen: float
    max_impacts: int
    max_states: int
    def set_switches(self, switches: list) -> None: ...

    states: list[tuple[float, float, float, float]]
    @property
    def transitions(self) -> list[tuple[int, list[int], list[int], bool, list[int], list[int], float, list[float]]]: ...

class Core:
    def __init__(self, model: Any, tolerances: Tolerances, description: dict) -> None: ...
    @property
    def rows(self) -> list[int]: ...
    @property
    def planar(self) -> bool: ...
    @property
    def rank(self) -> int: ...
    @property
    def floor(self) -> float: ...
    @property
    def calls_python(self) -> bool: ...
    def take_record(self) -> tuple: ...

    accuracy: float
    def use_rows(self, rows: Sequence[int], rank: int, floor: float, frozen: bool) -> None: ...
    def reset(self) -> None: ...
    def write(self, model: Any, tolerances: Tolerances, description: dict) -> bool: ...
    def set_input(self, input: int, t: float, value: float, rate: float) -> None: ...
    def change_law(self, k: int, a: Sequence[float]) -> None: ...
    def deactivate_rows(self, off: Sequence[bool], has_sticking_joints: bool) -> None: ...
    def update_independent_rows(self, t: float, y: Array, carry: Any | None) -> tuple[bool, Array, Any] | None: ...
    @overload
    def step(
        self, tableau: Tableau, t: float, h: float, y: Array, carry: Any | None, low: Array | None
    ) -> tuple[Array, Any, Array | None, Array, Array] | None: ...
    @overload
    def step(
        self, radau: Radau, t: float, h: float, y: Array, carry: Any | None, low: Array | None, controlled: bool
    ) -> tuple[Array, Any, Array | None, Array, Array] | None: ...
    @overload
    def step(
        self, composition: Composition, t: float, h: float, y: Array, carry: Any | None, low: Array | None
    ) -> tuple[Array, Any, Array | None, Array, Array] | None: ...
    @overload
    def step(
        self, alpha: GeneralizedAlpha, t: float, h: float, y: Array, carry: Any | None, low: Array | None
    ) -> tuple[Array, Any, Array | None, Array, Array] | None: ...
    @overload
    def advance(self, tableau: Tableau, run: Run) -> None: ...
    @overload
    def advance(self, radau: Radau, run: Run) -> None: ...
    @overload
    def advance(self, composition: Composition, run: Run) -> None: ...
    @overload
    def advance(self, alpha: GeneralizedAlpha, run: Run) -> None: ...
    def expand(self, model: Any) -> None: ...
    def set_sampled_controllers(self, controllers: list) -> None: ...
    def set_friction_interfaces(self, interfaces: list, active: Array, directions: Array) -> None: ...
    def set_smallest_slip(self, speed: float) -> None: ...
    def project_state(self, t: float, y: Array, tight: bool = False) -> Array | None: ...
    def partials(
        self, t: float, q: Array, u: Array, vdot: Array, lam: Array
    ) -> tuple[Array, Array, Array, Array, Array, Array] | None: ...
    def derivative(self, t: float, y: Array) -> tuple[Array, Array] | None: ...
    def raw_derivative(self, t: float, y: Array) -> tuple[Array, Array] | None: ...
    def derivatives(self, t: Array, y: Array) -> tuple[Array, Array]: ...
    def residuals(self, t: Array, y: Array) -> tuple[Array, Array, Array, bool]: ...
    def rows_of_all_modes(self, t: float, q: Array, v: Array) -> tuple[Array, Array, Array, Array] | None: ...
    def smallest_pivot(self, q: Array, rank: int) -> tuple[float, float] | None: ...
    def admissible_velocities(self, q: Array, vectors: Array) -> Array | None: ...
    def vanishing_combinations(self, q: Array, rank: int, limit: float, vectors: Array) -> tuple[int, Array] | None: ...
    def residual_of_dependent_rows(self, t: float, q: Array, limit: float, steps: int) -> float | None: ...
    def dynamics(self, q: Array, v: Array, a: Array) -> Any: ...
    def minimal_stage_seconds(self, q: Array, v: Array, repetitions: int) -> float: ...
    def start(
        self, t: float, y: Array, project: bool, ambiguous: float, fallen: float, dependent: float
    ) -> tuple[Array, Array, Array, list[int], float] | None: ...
    def remaining_rows_dependent(self, q: Array, tolerance: float) -> bool | None: ...
    def mass_matrices(self, q: Array, locations: Sequence[ParameterLocation], values: Array) -> Array: ...
    def first_step(self, t: float, y: Array, F: Array, given: FirstStep) -> float | None: ...
    @overload
    def begin(
        self, tableau: Tableau, start: RunStart, first_step: FirstStep | None, run: Run
    ) -> tuple[Array, Array, Array, list[int], float] | None: ...
    @overload
    def begin(
        self, radau: Radau, start: RunStart, first_step: FirstStep | None, run: Run
    ) -> tuple[Array, Array, Array, list[int], float] | None: ...
    @overload
    def begin(
        self, composition: Composition, start: RunStart, first_step: FirstStep | None, run: Run
    ) -> tuple[Array, Array, Array, list[int], float] | None: ...
    @overload
    def begin(
        self, alpha: GeneralizedAlpha, start: RunStart, first_step: FirstStep | None, run: Run
    ) -> tuple[Array, Array, Array, list[int], float] | None: ...
    @overload
    def solve_runs(
        self,
        tableau: Tableau,
        start: RunStart,
        first_step: FirstStep | None,
        run: Run,
        y: Array,
        locations: Sequence[ParameterLocation],
        values: Array,
        nodes: int,
        stop: Array,
    ) -> tuple[list[bool], Array, Array, Array, Array, list[list[int]]]: ...
    @overload
    def solve_runs(
        self,
        radau: Radau,
        start: RunStart,
        first_step: FirstStep | None,
        run: Run,
        y: Array,
        locations: Sequence[ParameterLocation],
        values: Array,
        nodes: int,
        stop: Array,
    ) -> tuple[list[bool], Array, Array, Array, Array, list[list[int]]]: ...
    @overload
    def solve_runs(
        self,
        composition: Composition,
        start: RunStart,
        first_step: FirstStep | None,
        run: Run,
        y: Array,
        locations: Sequence[ParameterLocation],
        values: Array,
        nodes: int,
        stop: Array,
    ) -> tuple[list[bool], Array, Array, Array, Array, list[list[int]]]: ...
    @overload
    def solve_runs(
        self,
        alpha: GeneralizedAlpha,
        start: RunStart,
        first_step: FirstStep | None,
        run: Run,
        y: Array,
        locations: Sequence[ParameterLocation],
        values: Array,
        nodes: int,
        stop: Array,
    ) -> tuple[list[bool], Array, Array, Array, Array, list[list[int]]]: ...
    def bind_parameters(self, count: int, components: list, directions: list, changed: list) -> Parameters: ...
    def recompute(
        self, method: Any, halved: bool, run: Run, t: Array, y: Array, carry: Array, same_state: float, agreement: float
    ) -> tuple[Array, list[int], int, Array] | None: ...
    def adjoint(
        self,
        parameters: Parameters,
        method: Any,
        halved: bool,
        project: bool,
        t: Array,
        y: Array,
        carries: Array,
        extra: Array,
        bar: Array,
        friction: Any | None = None,
    ) -> tuple[Array, Array] | None: ...
    def tangent(
        self,
        parameters: Parameters,
        method: Any,
        halved: bool,
        project: bool,
        t: Array,
        y: Array,
        carries: Array,
        first: Array,
        dp: Array,
        dh: Array | None = None,
        friction: Any | None = None,
    ) -> Array | None: ...
    def projection(self, parameters: Parameters, t: float, y: Array, positions: bool) -> tuple[Array, Array] | None: ...

class Run:
    @overload
    def __init__(self) -> None: ...
    @overload
    def __init__(self, other: Run) -> None: ...

    interval: SmoothInterval
    control: StepControl
    grid: Grid
    monitor: SingularityMonitor
    events: Events
    jumps: Jumps
    modes: Modes
    adaptive: bool
    project: bool
    monitored: bool
    tolerated_move: float
    tiny: float
    max_undone: float
    continued: bool
    seconds: float
    max_steps: int
    max_carries: int
    taken: int
    rejected: int
    needs_python: bool
    @property
    def row_changes(self) -> list[tuple[int, list[int]]]: ...
    @property
    def after_jumps(self) -> list[int]: ...
    def carries(self) -> tuple[Array, list[int]]: ...
    def set_state(self, y: Array, carry: Any | None, low: Array | None) -> None: ...
    def state(self) -> tuple[Array, Any, Array | None]: ...
    def steps(self) -> tuple[Array, Array, Array, Array]: ...

def partials_seconds(core: Core, q: Array, v: Array, repetitions: int) -> float: ...

class Parameters:
    pass
