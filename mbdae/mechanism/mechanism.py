"""Mechanism: a Pinocchio model, closures, forces and a start state; immutable."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from ..discovery import lazy_import
from ..errors import InputError, UnknownNameError
from ..system import Array
from ..tolerances import INPUT_DIGITS
from .assembly.assembly import assemble, assemble_start, require_consistent
from .closures.brake import Brake
from .closures.closure import Closure
from .closures.closure_error import ClosureError, largest_error
from .closures.clutch import Clutch
from .closures.constraints import Constraints, Spec, anchors
from .closures.driver import Driver
from .closures.unilateral_constraint import Stop
from .element_kinds import require_elements
from .equations.dynamics_terms import DynamicsTerms
from .flexible import require_leaves
from .forces import bind_forces, named_forces, require_signals, stiction_joints
from .forces.elements import ForceElements
from .formulations.closure_friction import ClosureFriction
from .formulations.compiled_systems import COMPILED
from .formulations.ggl import GGLSystem
from .formulations.index1 import Index1System
from .formulations.index2 import Index2System
from .formulations.workspace_pool import WorkspacePool
from .hybrid.reset import Reset, checked_resets
from .hybrid.switches import switches_of
from .joint_stops import resolve_stops
from .model_settings import Motor, OrderSettings, SolveSettings, Start, as_table, coordinates, vector
from .tree.frames import find_joint, joint_names
from .tree.joints import require_supported
from .tree.manifold import Manifold

if TYPE_CHECKING:
    from .scene.scene import Scene

Coordinates = Mapping[str, float | Sequence[float]]
SYSTEMS: dict[str, Callable[..., Index2System]] = {s.formulation: s for s in (Index2System, GGLSystem, Index1System)}


class Mechanism(DynamicsTerms):
    """A constrained mechanism in index-2 descriptor form.

        q' = v,   M(q) v' = f(t, q, v) + G(q)^T lam,   0 = G(q) v + g_t(t)

    Args:
        model: a Pinocchio model; its gravity applies, its friction does not, its limits only if a stop refers to them.
        closures: loop closures, see `mbdae.Closure`.
        drivers: joints, couplings or distances that follow functions of time, see `mbdae.Driver`.
        stops: limits of joint motions, see `mbdae.Stop`.
        clutches: one-way, ratchet and commanded clutches, see `mbdae.Clutch`.
        resets: events at which the state jumps, see `mbdae.Reset`.
        forces: descriptions of forces, or functions tau(t, q, v) -> (nv,) in N m and N.
        start: values of joints at the start, ``{"q": {joint: x}}``, see `mbdae.mechanism.model_settings.Start`.
        visuals: Pinocchio geometry for the replay; generated from the joints when left out.
        title: title, one line.
        duration: default end time of a run in s.
        order: settings of the order study.
        settings: defaults of `mbdae.solve` for this mechanism.
        source: origin of the mechanism, kept in saved solutions.
        motors: named inputs, to which `mbdae.load` assigns controls.
        left_out: features of the files that are not supported.
        remarks: the unsupported features that are worth a warning.

    Raises:
        UnknownNameError: for an unknown frame or joint.
        InputError: for wrong values.

    Example:
        >>> mech = Mechanism(model, closures=[Closure.point("left_tip", "right_tip")])   # doctest: +SKIP
    """

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[Closure] = (),
        forces: Sequence[object] = (),
        *,
        drivers: Sequence[Driver] = (),
        stops: Sequence[Stop] = (),
        clutches: Sequence[Clutch] = (),
        resets: Sequence[Reset] = (),
        start: Start | dict[str, Any] | None = None,
        visuals: pin.GeometryModel | None = None,
        title: str = "",
        duration: float = 10.0,
        order: OrderSettings | dict[str, Any] | None = None,
        settings: SolveSettings | dict[str, Any] | None = None,
        source: dict[str, Any] | None = None,
        motors: Sequence[Motor] = (),
        left_out: Sequence[str] = (),
        remarks: Sequence[str] = (),
    ) -> None:
        require_supported(model)
        require_elements(closures=closures, drivers=drivers, stops=stops, clutches=clutches, resets=resets)
        self.model, self.visuals, self.source, self.title = model, visuals, source, title or model.name
        self.duration, self.start_values = duration, as_table(Start, start)
        self.order, self.settings = as_table(OrderSettings, order), as_table(SolveSettings, settings)
        self.motors, self.left_out, self.remarks = tuple(motors), tuple(left_out), tuple(remarks)
        self.closures, self.drivers, self.stops = tuple(closures), tuple(drivers), resolve_stops(model, stops)
        self.forces = named_forces(forces, self.drivers)
        self.clutches, brakes = tuple(clutches), tuple(Brake(*data) for data in stiction_joints(model, self.forces))
        self.constraints: tuple[Spec, ...] = (*self.closures, *self.drivers, *self.stops, *self.clutches, *brakes)
        if len({c.name for c in self.constraints}) < len(self.constraints):
            names = ", ".join(c.name for c in self.constraints)
            raise InputError(f"closures, drivers and stops need different names, got {names}")
        require_leaves(model)
        self.closure_anchors, data = [(c, anchors(model, c)) for c in self.closures if c.frames], self.make_workspace()
        bound = Constraints(model, data, self.constraints)  # rejects unknown names
        self.row_names = [c.name for c in self.constraints for _ in range(c.m)]
        self.ng, self._spans, self.row_units, self.positional = bound.ng, bound.spans, bound.units(), bound.positional
        self.switches, self.manifold = switches_of(self), Manifold(model)
        ClosureFriction(self.forces, self.closures, bound)  # rejects unknown names
        self.states = self.bind_forces(data).states()  # rejects unknown names
        self.workspaces, self._positions = WorkspacePool(self), dict[Any, Any]()
        self.resets, self._starts = checked_resets(self, resets), dict[float, tuple[Array, Array]]()
        require_signals(self)
        for name in (name for table in self.start_values.tables.values() for name in table):
            find_joint(model, name)

    def __repr__(self) -> str:
        return f"<Mechanism {self.title}: nq {self.nq}, nv {self.nv}, {self.ng} closure rows>"

    def _repr_html_(self) -> str:
        return lazy_import("mbdae.studies.info.card", "card")(self)._repr_html_()

    def view(self, q: Array | None = None) -> Any:
        """Return a page with sliders that move the mechanism from q (nq,), by default its start: see `mbdae.view`."""
        return lazy_import("mbdae.studies.view.view", "view")(self, q)

    # -- sizes and names -----------------------------------------------------------------------------------------

    @property
    def nq(self) -> int:
        """Length of a configuration q."""
        return self.model.nq

    @property
    def nv(self) -> int:
        """Length of a velocity v."""
        return self.model.nv

    @cached_property
    def joint_names(self) -> list[str]:
        """Names of the joints in the order of q."""
        return joint_names(self.model)

    def coordinate_joint(self, i: int) -> str:
        """Return the name of the joint of velocity component i."""
        return next(
            n for n in self.joint_names if 0 <= i - find_joint(self.model, n).idx_v < find_joint(self.model, n).nv
        )

    def joint_kind(self, name: str) -> str:
        """Return Pinocchio's name of the kind of a joint, for instance ``"RX"`` or ``"Spherical"``."""
        return find_joint(self.model, name).shortname().removeprefix("JointModel")

    def rows_of(self, name: str) -> range:
        """Return the row indices of a closure, driver, stop or clutch; ``row_names`` is the inverse.

        Raises:
            UnknownNameError: lists the valid names.
        """
        if name not in self._spans:
            raise UnknownNameError("closure or driver", name, self._spans)
        return range(self.ng)[self._spans[name]]

    @cached_property
    def scene(self) -> "Scene":
        """Shapes and placements for the replay."""
        return lazy_import("mbdae.mechanism.appearance", "appearance")(self)  # type: ignore[no-any-return]

    def bind_forces(self, data: pin.Data) -> ForceElements:
        """Bind every force to a workspace, see `make_workspace`."""
        return bind_forces(self.forces, self.model, data)

    def system(
        self, formulation: str = "index2", baumgarte: tuple[float, float] | None = None,
        native: ModuleType | None = None,
    ) -> Index2System:
        """Bind the mechanism to a new workspace; ``data`` of the system serves all algorithms of Pinocchio.

        Args:
            formulation: ``"index2"``, ``"ggl"`` (also enforces positions) or ``"index1"`` (accelerations).
            baumgarte: alpha and beta in 1/s, for ``"index1"`` only.
            native: the compiled core, see `mbdae.backend`.

        Raises:
            UnknownNameError: for another formulation.
            InputError: for an invalid baumgarte, or one for another formulation.
            NotCompiled: names the feature that the core does not support.
        """
        if formulation not in SYSTEMS:
            raise UnknownNameError("formulation", formulation, SYSTEMS)
        if baumgarte is not None and formulation != "index1":
            raise InputError(f"baumgarte belongs to formulation 'index1', got it with {formulation!r}")
        given = {name: x for name, x in (("baumgarte", baumgarte), ("native", native)) if x is not None}
        return (COMPILED if native else SYSTEMS)[formulation](self, **given)

    def coordinates(self, q: Coordinates, *, of_v: bool = False) -> tuple[Array, Array]:
        """Return values and tangent indices of the coordinates that a table ``joint = value`` names.

        The values are a full q (nq,), neutral by default, or a full v (nv,).
        """
        return coordinates(self.model, q, of_v=of_v)

    def assemble(
        self,
        q: Coordinates | Array | None = None,
        v: Coordinates | Array | None = None,
        *,
        guess: Coordinates | None = None,
        t: float = 0.0,
    ) -> tuple[Array, Array]:
        """Return consistent initial conditions: g(t, q) = 0 and G(q) v + g_t(t) = 0.

        Modes of flexible bodies that are not named stay undeformed and at rest, unless only they can close a loop.

        Args:
            q: fixed joint values, by name; or a full configuration (nq,) to start from, nothing fixed.
            v: fixed joint velocities, by name; or a full velocity (nv,), changed as little as possible in the mass
                metric. Zero when left out.
            guess: initial estimates of joint values, by name; the model's start state when left out.
            t: time in s, relevant for drivers.

        Returns:
            q (nq,) and v (nv,).

        Raises:
            AssemblyError: names the closure with the largest violation, its size, and the fixed coordinates.
            UnknownNameError: for an unknown joint.
        """
        return assemble(self, q, v, guess, t=t)[:2]

    @property
    def start(self) -> tuple[Array, Array]:
        """The model's consistent start state q (nq,), v (nv,) at t = 0; see `start_at`."""
        return self.start_at(0.0)

    def start_at(self, t: float) -> tuple[Array, Array]:
        """Return the model's consistent start state q (nq,), v (nv,) at time t, relevant for drivers.

        Where drivers determine a position or a speed, its start value is only an initial estimate.

        Raises:
            AssemblyError: if the model file's values cannot be made consistent.
            InputError: if they are inconsistent and assembly is disabled.
        """
        t = t if self.drivers else 0.0
        if t not in self._starts:
            if not self.start_values.assemble:
                require_consistent(self, *self.unassembled_start, t)
                return self.unassembled_start
            self._starts[t] = assemble_start(self, t)[:2]
        return self._starts[t]

    @property
    def unassembled_start(self) -> tuple[Array, Array]:
        """Start values of the file, before assembly: q (nq,), v (nv,)."""
        values = self.start_values
        q = self.coordinates({**values.guess, **values.q})[0]
        return q, self.coordinates({**values.guess_v, **values.v}, of_v=True)[0]

    @property
    def start_violation(self) -> ClosureError | None:
        """Closure with the largest violation at the start values before assembly; None without closures."""
        return largest_error(self, self.residual(*self.unassembled_start)[0]) if self.ng else None

    def point(
        self, q: Array | None = None, v: Array | None = None, t: float = 0.0, s: Array | None = None,
        tolerance: float = INPUT_DIGITS, residual: Callable[..., tuple[Array, Array]] | None = None,
    ) -> Array:
        """Return y = (q, v, s, w = 0) at time t; by default at the start state, with start values of s.

        Closures may be violated by ``tolerance``, in rad or characteristic lengths; ``residual`` replaces `residual`.

        Raises:
            InputError: for wrong shapes, values that are not finite, or a state that is not consistent.
        """
        s_w = np.array([*(self.states.values() if s is None else vector(self.title, "s", s, len(self.states))), 0.0])
        if q is None and v is None:
            return np.concatenate([*self.start_at(t), s_w])
        q0 = self.configuration(self.start_at(t)[0] if q is None else q)
        v0 = self.start_at(t)[1] if v is None else vector(self.title, "v", v, self.nv)
        require_consistent(self, q0, v0, t, tolerance, residual)
        return np.concatenate([q0, v0, s_w])

    def vector(self, name: str, value: object, n: int) -> Array:
        """Return a value as n finite numbers, see `mbdae.mechanism.model_settings.vector`."""
        return vector(self.title, name, value, n)
