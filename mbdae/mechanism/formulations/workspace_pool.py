"""Pool of workspaces, which runs reuse after earlier runs of the mechanism have released them."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ...errors import NotCompiled
from ...system import Array, Counts
from ...tolerances import AMBIGUOUS_PIVOT, ZERO_SPEED
from ..closures import independent_rows
from ..forces import is_custom
from .closure_friction import ClosureFriction

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .index2 import Index2System


class RunVariables:
    """Mutable state of a workspace during a run: rows in use, extremes so far and counts."""

    ng: int
    nq: int
    mode: tuple[int, ...]
    closure_friction: ClosureFriction

    def reset(self) -> None:
        """Return to the state of a new workspace, in the first mode."""
        self.enter((0,) * len(self.mode))
        self.closure_friction.reset()
        self.set_min_slip_speed(ZERO_SPEED)
        self.counts = Counts()
        self.rank: int | None = None
        self.ambiguous_pivot = AMBIGUOUS_PIVOT  # pivot ratio below which the branch of a motion is ambiguous
        self.rank_threshold = 0.0  # pivot ratio below which the rank has dropped
        self.rows: Array | None = None
        self.rows_frozen = False  # whether only `update_independent_rows` may change the rows in use
        self.selection_trigger = independent_rows.SelectionTrigger(self.ng)
        self.least_pivot_ratio = 1.0  # smallest pivot ratio of G M^-1 G^T in all solves
        # |g| and |G v + g_t| over all rows, and |v|, at ends of steps; lengths in characteristic lengths
        self.largest_g = self.largest_rate = self.largest_speed = 0.0
        self.accuracy = 0.0
        self._last_q: Array | None = None  # configuration of the last stage

    def enter(self, mode: tuple[int, ...]) -> None:
        """Enter another mode."""
        raise NotImplementedError

    def set_min_slip_speed(self, speed: float) -> None:
        """Set the speed in m/s below which the slip direction is undefined, also in the core."""
        self.closure_friction.min_slip_speed = speed
        if core := getattr(self, "core", None):
            core.set_smallest_slip(speed)


class WorkspacePool:
    """Idle workspaces of a mechanism; threads may acquire and release them concurrently.

    Variants of a mechanism with different parameters share idle workspaces, and bind them in place. Workspaces with
    Baumgarte stabilization or third-party forces are not pooled, because they cannot be reset.

    Args:
        mechanism: the mechanism.
        idle: the idle workspaces that it shares with variants, by formulation and back end.
    """

    def __init__(self, mechanism: "Mechanism", idle: dict[tuple[str, bool], list[Any]] | None = None) -> None:
        self.mechanism = mechanism
        self.pooled = not any(is_custom(f) for f in mechanism.forces)
        self.idle = defaultdict(list) if idle is None else idle

    def of(self, mechanism: "Mechanism") -> "WorkspacePool":
        """Return the pool of a variant of the mechanism."""
        return WorkspacePool(mechanism, self.idle)

    def __getstate__(self) -> dict[str, Any]:
        """Omit idle workspaces from a pickled or copied mechanism."""
        return self.__dict__ | {"idle": defaultdict(list)}

    def acquire(
        self,
        formulation: str = "index2",
        baumgarte: tuple[float, float] | None = None,
        native: ModuleType | None = None,
    ) -> "Index2System":
        """Return an idle or a new workspace; for arguments and errors see `Mechanism.system`."""
        if baumgarte is None:
            try:
                system: Index2System = self.idle[formulation, native is not None].pop()
            except IndexError:
                pass
            else:
                if _shares_all_but_start(system.mechanism, self.mechanism):
                    system.mechanism = self.mechanism
                else:
                    system.bind(self.mechanism)
                return system
        return self.mechanism.system(formulation, baumgarte, native)

    def release(self, system: "Index2System") -> None:
        """Reset a workspace that is no longer in use, for the next run."""
        if self.pooled and not any(system.baumgarte):
            system.reset()
            self.idle[system.formulation, system.native is not None].append(system)

    @contextmanager
    def borrowed(self, native: ModuleType | None = None) -> "Iterator[Index2System]":
        """Lend a workspace for one evaluation, in Python by default: binding takes longer than most evaluations."""
        system = self.acquire(native=native)
        yield system
        self.release(system)

    def supported_by(self, native: ModuleType) -> bool:
        """Return whether the core supports the mechanism."""
        with suppress(NotCompiled), self.borrowed(native):
            return True
        return False


def _shares_all_but_start(a: "Mechanism", b: "Mechanism") -> bool:
    """Return whether variants of a mechanism share everything that is bound to a workspace."""
    return a.model is b.model and a.constraints is b.constraints and a.forces is b.forces
