"""The compiled core for type checkers; what fields mean stands in mbdae/native/*/*.hpp."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

Array = np.ndarray

def version() -> str: ...
def sweeps(model: pin.Model) -> bool: ...

class UnknownKind(ValueError): ...

class Tolerances:
    def __init__(
        self,
        *,
        largest_turn: float,
        series: Sequence[float],
        series_end: float,
        same_point: float,
        smallest_pivot: float,
        independent: float,
        worst_conditioning: float,
        grown: float,
        many: int,
        reason: float,
        probed: float,
        converged: float,
        eps: float,
        spare: int,
        truncation: float,
        rounding: float,
        falling: float,
        open: float,
        stalled: float,
        kept: float,
        iterations: int,
        unmoved: float,
        row_scales: list[float],
        q_scales: list[float],
        coordinate_scales: list[float],
        meeting: int,
        met: float,
        halted: float,
        gaping: float,
        still: float,
        turned: float,
        loading: int,
        loaded: float,
        settled: float,
        nothing: float,
        restages: int,
        restaged: float,
    ) -> None: ...

class Tableau:
    def __init__(
        self,
        A: Array,
        Ahat: Array,
        b: Array,
        c: Array,
        chat: Array,
        e: Array,
        first: bool,
        project: bool,
        doubled: int,
        noise: float,
    ) -> None: ...

class StageMemory: ...

class Radau:
    def __init__(
        self,
        c: Array,
        A: Array,
        modes: list[tuple[complex, list[complex], list[complex]]],
        real: int,
        gamma: float,
        start: Array,
        middle: int,
        *,
        patience: int,
        short_patience: int,
        tolerance: float,
        near: float,
        further: int,
        first: int,
        expected: float,
        reuse: float,
        share: float,
    ) -> None: ...

class SmoothInterval:
    t: float
    sign: float
    stop: float
    end: float
    t1: float

class StepControl:
    h: float
    cut: float
    last: float
    rejected: bool
    largest: float
    rtol: float
    atol: list[float]
    nothing: float
    companion: float
    blend: float
    power: float
    exponent: float
    last_exponent: float
    safety: float
    smallest_factor: float
    largest_factor: float
    steady: float
    smallest_error: float
    smallest_last: float
    nearly: float
    spacings: float

class Grid:
    i: int
    on_grid: bool
    step: float
    t0: float
    n: int
    near: float

class SingularityMonitor:
    usual: float
    before: float
    suspect: float
    landed: float
    zone: float
    ahead: float
    entered: bool

class Events:
    start: float
    same: float
    spacings: float
    share: float
    iterations: int
    @property
    def nodes(self) -> list[tuple[float, float, float]]: ...
    @property
    def found(self) -> list[tuple[int, float, Array]]: ...
    @property
    def stopped(self) -> bool: ...
    def watch(self, events: list[tuple[tuple[str, int, int, list[int]], float, int, bool]]) -> None: ...
    def stand(self, nodes: list[tuple[float, float, float]]) -> None: ...

class Jumps:
    crossed: bool
    times: list[float]
    margin: float
    crowd: int
    restart: float

class Run:
    events: Events
    jumps: Jumps
    leg: SmoothInterval
    control: StepControl
    grid: Grid
    watch: SingularityMonitor
    adaptive: bool
    project: bool
    watched: bool
    tolerated: float
    taken_back: float
    nothing: float
    seconds: float
    budget: int
    kept: int
    @property
    def taken(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def stuck(self) -> bool: ...
    @property
    def changes(self) -> list[tuple[int, list[int]]]: ...
    @property
    def behind(self) -> list[int]: ...
    def carried(self) -> tuple[Array, list[int]]: ...
    def begin(self, y: Array, carry: Any, low: Array | None) -> None: ...
    def state(self) -> tuple[Array, Any, Array | None]: ...
    def steps(self) -> tuple[Array, Array, Array, Array]: ...

class Parameters: ...

class Core:
    def __init__(
        self,
        model: pin.Model,
        limits: Tolerances,
        flat: bool,
        pairs: list[Any],
        rows: list[dict[str, Any]],
        drivers: list[dict[str, Any]],
        law_pairs: list[Any],
        laws: list[dict[str, Any]],
        ns: int,
        blocks: list[tuple[str, int, int]],
        turning: list[int],
        angles: list[tuple[int, int]],
        place: list[int],
        probe: list[float],
        formulation: str = "index2",
        alpha: float = 0.0,
        beta: float = 0.0,
    ) -> None: ...
    @property
    def rows(self) -> list[int]: ...
    @property
    def rank(self) -> int: ...
    def every(self, t: float, y: Array) -> tuple[Array, Array] | None: ...
    def slowest_slip(self, speed: float) -> None: ...
    def restore(self, t: float, y: Array) -> Array | None: ...
    accuracy: float
    def reset(self) -> None: ...
    def take_record(self) -> tuple[Any, ...]: ...
    def change_law(self, k: int, a: list[float]) -> None: ...
    def leave_out(self, off: list[bool], sticks: bool) -> None: ...
    def use(self, rows: list[int], rank: int, floor: float, held: bool) -> None: ...
    def update_independent_rows(self, t: float, y: Array, carry: Any) -> tuple[bool, Array, Any] | None: ...
    def expand(self, model: pin.Model) -> None: ...
    def partials(
        self, t: float, q: Array, u: Array, vdot: Array, lam: Array
    ) -> tuple[Array, Array, Array, Array, Array, Array] | None: ...
    def step(
        self, method: Any, t: float, h: float, y: Array, carry: Any, low: Array | None, *controlled: bool
    ) -> tuple[Array, Any, Array | None, Array, Array] | None: ...
    def advance(self, method: Any, run: Run) -> None: ...
    def derivative(self, t: float, y: Array) -> tuple[Array, Array] | None: ...
    def rate(self, t: float, y: Array) -> tuple[Array, Array] | None: ...
    def derivatives(self, t: Array, y: Array) -> tuple[Array, Array]: ...
    def sample(self, samplers: list[dict[str, Any]]) -> None: ...
    def slide(self, places: list[dict[str, Any]], active: Array, heading: Array) -> None: ...
    def residuals(self, t: Array, y: Array) -> tuple[Array, Array, Array]: ...
    def ratio(self, q: Array, rank: int) -> float | None: ...
    def dynamics(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array, Array, Array]: ...
    def bare(self, q: Array, v: Array, repetitions: int) -> float: ...
    def vary(
        self,
        count: int,
        stuff: list[tuple[str, int, bool, bool]],
        directions: list[tuple[int, int, list[float]]],
        changed: list[tuple[int, list[int], list[Any], list[Any]]],
    ) -> Parameters: ...
    def recompute(
        self,
        method: Any,
        halved: bool,
        run: Run,
        t: Array,
        y: Array,
        carry: Array,
        repeated: float,
        synchronous: float,
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
        friction: Callable[..., tuple[Array, Array, Array]] | None = None,
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
        friction: Callable[..., tuple[Array, Array, Array]] | None = None,
    ) -> Array | None: ...
    def projection(
        self, parameters: Parameters, t: float, y: Array, positions: bool
    ) -> tuple[Array, Array] | None: ...

def partials_seconds(core: Core, q: Array, v: Array, repetitions: int) -> float: ...
