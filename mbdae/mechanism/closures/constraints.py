"""All rows of a mechanism, of closures, drivers, stops, clutches and brakes, bound to a workspace.

    0 = g(t, q) = c(q) - u(t),   G = dc/dq,   g_t = -u',   gamma = Gdot v + g_tt,   g_tt = -u''

with u = 0 for all but drivers. Neither G nor its rate depends explicitly on time, and g_tq = 0. Velocity rows have no
g: their entries are 0.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import pairwise
from math import isfinite, nan
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import pinocchio as pin

from ...errors import InputError, StepError
from ...system import Array
from ..tree.frames import Anchor, Pair, anchor, support
from ..tree.wrench_partials import PairPartials
from .brake import Brake
from .closure import Closure
from .clutch import Clutch
from .driver import Driver
from .joint_rows import BoundJointRow, JointRow
from .rows import FrameRows
from .unilateral_constraint import Stop

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Spec = Closure | Driver | Stop | Brake | Clutch


class BoundFrameRows(NamedTuple):
    """Rows between two frames: their indices, their kind, and their wrenches in `Constraints.W`."""

    pair: Pair
    rows: tuple[tuple[slice, FrameRows, Array], ...]


class Constraints:
    """All rows, evaluated at the current kinematics of a workspace.

    Args:
        model: the model.
        data: a workspace of the model.
        specs: closures, drivers, stops, clutches and brakes.

    Attributes:
        frame_rows: bound rows of each closure or driver between frames, by its name.
        joint_rows: bound rows between joints.
        spans: slice of the rows of each closure, driver, stop, clutch and brake, by name.
        driven: indices of the rows that follow functions of time, and their drivers.
        positional: which rows have a g, (ng,).
        W: wrenches of the rows between frames at the last evaluation of G, (6, ng).
        nonsmooth_times: times at which u'' of a driver jumps.
        inactive: indices of the inactive rows of the mode; their g, G and Gdot v are 0.
    """

    def __init__(self, model: pin.Model, data: pin.Data, specs: Sequence[Spec]) -> None:
        self.frame_rows: dict[str, BoundFrameRows] = {}
        self.joint_rows: list[BoundJointRow] = []
        starts = np.cumsum([0, *(spec.m for spec in specs)]).tolist()
        self.spans = {spec.name: slice(*ends) for spec, ends in zip(specs, pairwise(starts), strict=True)}
        self.driven = [(self.spans[d.name].start, d) for d in specs if isinstance(d, Driver)]
        self.ng = starts[-1]
        self._columns: list[Array] = [np.empty(0, int)] * self.ng
        self.nv, self.W = model.nv, np.zeros((6, self.ng))
        self.positional, self.inactive = np.ones(self.ng, bool), np.empty(0, int)
        for spec in specs:
            if spec.frames:
                self._between_frames(model, data, spec)
            else:
                self._between_joints(model, data, spec)
        self.positional[[at for at, d in self.driven if d.speed is not None]] = False
        self._J = data.J.reshape(6, -1)  # with nv = 1 it is a vector
        bound = self.frame_rows.items()
        self._node_rows = [(self.spans[name], *node) for name, (pair, _) in bound for node in pair.nodes]
        self._zero_motion = np.zeros((3, self.ng))
        self._index_special_rows()
        self.nonsmooth_times = sorted({t for _, driver in self.driven for t in driver.nonsmooth_times()})

    def _index_special_rows(self) -> None:
        """Find driven distances, periodic rows (of angles), and velocity rows."""
        self._driven_distances = [at for at, d in self.driven if d.frames and d.motion]
        periodic = [p for p in self.joint_rows if p.period and self.positional[p.at]]
        self._periodic = np.array([p.at for p in periodic], int)
        self._periods = np.array([p.period for p in periodic])
        self._velocity_rows = np.flatnonzero(~self.positional)

    def _between_frames(self, model: pin.Model, data: pin.Data, spec: Spec) -> None:
        """Bind the rows between two frames."""
        pair, all_rows = Pair(model, data, *anchors(model, spec)), self.spans[spec.name]
        rows: list[tuple[slice, FrameRows, Array]] = []
        at = all_rows.start
        for r in cast(Sequence[FrameRows], spec.primitives()):
            span = slice(at, at := at + r.m)
            rows.append((span, r, self.W[:, span]))
            self.positional[span] = r.positional
        self.frame_rows[spec.name] = BoundFrameRows(pair, tuple(rows))
        self._columns[all_rows] = [pair.columns] * spec.m

    def _between_joints(self, model: pin.Model, data: pin.Data, spec: Spec) -> None:
        """Bind the rows between joints."""
        for at, r in enumerate(cast(Sequence[JointRow], spec.primitives()), self.spans[spec.name].start):
            bound = r.bind(model, data, at, spec.name)
            self.joint_rows.append(bound)
            self.positional[at] = r.positional
            self._columns[at] = np.flatnonzero(sum(support(model, j.id) for j in bound.joints))

    def units(self) -> Array:
        """Return the unit of each row's g, ``"m"`` or ``"rad"``, (ng,)."""
        out = np.empty(self.ng, object)
        for s, r, _ in (bound for _, rows in self.frame_rows.values() for bound in rows):
            out[s] = r.unit
        for row in self.joint_rows:
            out[row.at] = row.unit
        return out

    @cached_property
    def columns(self) -> "csr_array":
        """Velocities on which each row depends, those of its joints and their ancestors: a pattern (ng, nv)."""
        from scipy.sparse import csr_array

        starts, at = np.cumsum([0, *map(len, self._columns)]), np.concatenate([np.empty(0, int), *self._columns])
        return csr_array((np.ones(len(at), bool), at, starts), shape=(self.ng, self.nv))

    @cached_property
    def sign(self) -> Array:
        """Signs of the columns of J in each row between frames, (ng, nv), see `mbdae.mechanism.tree.frames.Pair`."""
        out = np.zeros((self.ng, self.nv))
        for name, (pair, _) in self.frame_rows.items():
            out[self.spans[name]] = pair.sign
        return out

    def update_wrenches(self, names: Iterable[str]) -> None:
        """Store the wrenches of the rows between frames of these closures in W."""
        for name in names:
            pair, rows = self.frame_rows[name]
            pair.locate()
            try:
                for _, r, w in rows:
                    r.wrenches(pair, w)
            except StepError as e:
                raise StepError(e.status, f"closure {name!r}: {e}") from None

    def jacobian(self) -> Array:
        """Return G, (ng, nv), and store the wrenches of the rows in W."""
        self.update_wrenches(self.frame_rows)
        G = self.W.T.dot(self._J)
        G *= self.sign
        for span, sign, body, node in self._node_rows:
            G[span, body.at] += sign * self.W[:, span].T.dot(node.columns)
        for row in self.joint_rows:
            G[row.at, row.columns] = row.value()[1]
        if len(self.inactive):
            G[self.inactive] = 0.0
        return G

    def sparse_jacobian(self) -> "csr_array":
        """Return G without its zeros, (ng, nv), and store the wrenches of the rows in W: memory of order ng."""
        from scipy.sparse import coo_array

        self.update_wrenches(self.frame_rows)
        rows, columns, moving = self._structure
        entries = [w.dot(self._J[:, at]) * sign for w, at, sign in moving]
        entries += [sign * self.W[:, span].T.dot(node.columns) for span, sign, _, node in self._node_rows]
        entries += [np.array(row.value()[1], float) for row in self.joint_rows]
        data = np.concatenate([np.empty(0), *(x.ravel() for x in entries)])
        data[np.isin(rows, self.inactive)] = 0.0
        out = coo_array((data, (rows, columns)), shape=(self.ng, self.nv)).tocsr()
        out.eliminate_zeros()
        return out

    @cached_property
    def _structure(self) -> tuple[Array, Array, list[tuple[Array, Array, Array]]]:
        """Rows and columns of the entries of `sparse_jacobian`; and w^T, columns of J and signs of each pair."""
        moving, blocks = [], []
        for name, (pair, _) in self.frame_rows.items():
            at = np.flatnonzero(pair.sign)
            moving.append((self.W[:, self.spans[name]].T, at, pair.sign[at]))
            blocks.append((self.spans[name], at))
        blocks += [(span, np.arange(body.at.start, body.at.stop)) for span, _, body, _ in self._node_rows]
        blocks += [(slice(row.at, row.at + 1), np.array(row.columns, int)) for row in self.joint_rows]
        rows = [np.repeat(np.arange(s.start, s.stop), len(at)) for s, at in blocks]
        columns = [np.tile(at, s.stop - s.start) for s, at in blocks]
        none = np.empty(0, int)
        return np.concatenate([none, *rows]), np.concatenate([none, *columns]), moving

    def value(self, t: float | None) -> tuple[Array, Array]:
        """Return g(t, q) (ng,), 0 for velocity rows, and G (ng, nv); without t, g of driven rows is nan."""
        G = self.jacobian()
        return self._residual(t), G

    def residual(self, t: float | None) -> Array:
        """Return g(t, q) alone, see `value`."""
        for pair, _ in self.frame_rows.values():
            pair.locate()
        return self._residual(t)

    def _residual(self, t: float | None) -> Array:
        g = np.zeros(self.ng)
        for pair, rows in self.frame_rows.values():
            for s, r, _ in rows:
                g[s] = r.residual(pair)
        for row in self.joint_rows:
            g[row.at] = row.value()[0]
        if self.driven:
            g -= self.motion(t)[0]
        if len(self._periodic):
            g[self._periodic] -= self._periods * np.round(g[self._periodic] / self._periods)
        g[self._velocity_rows] = g[self.inactive] = 0.0
        return g

    def bias(self, v: Array) -> Array:
        """Return Gdot v, (ng,); velocities v (nv,), and accelerations for v' = 0, must be current in the workspace."""
        out = np.zeros(self.ng)
        for pair, rows in self.frame_rows.values():
            pair.locate()
            pair.twist()
            bias, relative = pair.bias(), pair.Vb - pair.Va
            for s, r, w in rows:
                out[s] = relative @ r.wrenches_and_rate(pair, w) + bias @ w
        for row in self.joint_rows:
            out[row.at] = row.bias(v)
        out[self.inactive] = 0.0
        return out

    def partials(self, v: Array, lam: Array, names: Iterable[str] | None = None) -> tuple[Array, Array]:
        """Return d(G^T lam)/dq (nv, nv) and d(G v)/dq (ng, nv) for v (nv,), lam (ng,), after `jacobian`.

        With names: only for the rows between frames of these closures, after `update_wrenches`.
        """
        K, B = np.zeros((len(v), len(v))), np.zeros((self.ng, len(v)))
        for name in self.frame_rows if names is None else names:
            pair, rows = self.frame_rows[name]
            local, F, D = PairPartials(pair, v), np.zeros(6), np.zeros((2, 36))
            at = local.at
            for s, r, w in rows:
                Da, Db = r.partials(pair)
                B[s, at] = local.power(w, Da, Db)
                F += w.dot(lam[s])
                D += lam[s].dot(Da.reshape(-1, 36)), lam[s].dot(Db.reshape(-1, 36))
            K[at[:, None], at] += local.generalized_force(F, *D.reshape(2, 6, 6))
        for row in self.joint_rows if names is None else ():
            row.partials(v, float(lam[row.at]), K, B[row.at])
        B[self.inactive] = 0.0
        return K, B

    def bias_partials(self, v: Array) -> tuple[Array, Array]:
        """Return the partial derivatives of Gdot v with respect to q and v, (ng, nv) each, after `jacobian`."""
        by_q, by_v = np.zeros((2, self.ng, len(v)))
        for pair, rows in self.frame_rows.values():
            local = PairPartials(pair, v)
            at = local.at
            for s, r, w in rows:
                by_q[s, at], by_v[s, at] = local.bias(r.rate, w, *r.partials(pair))
        for row in self.joint_rows:
            row.bias_partials(v, by_q[row.at], by_v[row.at])
        by_q[self.inactive] = by_v[self.inactive] = 0.0
        return by_q, by_v

    def motion(self, t: float | None) -> Array:
        """Return u, u' and u'' of all rows, (3, ng): zero for closures; nan for drivers without t.

        Raises:
            StepError: if a driver is not defined at t, or drives a distance to zero.
        """
        if not self.driven:
            return self._zero_motion
        out = np.zeros((3, self.ng))
        for at, driver in self.driven:
            out[:, at] = motion = (nan,) * 3 if t is None else driver.follow(t)
            if t is not None and not all(map(isfinite, motion)):  # faster than `numpy.isfinite`
                raise StepError("driver", f"driver {driver.name!r} is not finite at t = {t:.17g}: {out[:, at]}")
        for at in self._driven_distances:
            if out[0, at] <= 0:
                name = next(d.name for i, d in self.driven if i == at)
                raise StepError("driver", f"driver {name!r} requires a distance of {out[0, at]:.3g} m at t = {t:.9g}")
        return out


def spec_kind(spec: Spec) -> str:
    """Return the kind of a closure, or ``"driver"``, ``"stop"``, ``"clutch"`` or ``"brake"``."""
    return spec.kind if isinstance(spec, Closure) else type(spec).__name__.lower()


def anchors(model: pin.Model, spec: Spec) -> tuple[Anchor, Anchor]:
    """Return the anchors of a closure or driver between two frames.

    Raises:
        InputError: if both are on the same body.
    """
    a, b = (anchor(model, name) for name in spec.frames or ("", ""))
    if a.joint == b.joint:
        what = "closure" if isinstance(spec, Closure) else "driver"
        raise InputError(f"{what} {spec.name!r} closes nothing: {a.name!r} and {b.name!r} are on the same body")
    return a, b
