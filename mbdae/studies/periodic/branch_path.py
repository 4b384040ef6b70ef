"""Continuation of periodic motions over a parameter.

The equations of shooting rho(x, T, sigma, p) = 0 (`mbdae.studies.periodic.shooting.shooting_equations`) define a curve
with unit tangent tau,

    A tau = 0,   predictor h tau,   corrector [A; tau^T] dz = [-rho; 0]

in rad, characteristic lengths, periods and fractions of the parameter's range. Test functions change sign at

    fold: tau_p;   period doubling: prod (mu_i + 1);   Neimark-Sacker: prod_{i<j} (mu_i mu_j - 1), of a complex pair;
    branch point: prod (mu_i - 1), where the parameter does not turn back

Source: Keller (1977); Seydel, Practical bifurcation and stability analysis; Kuznetsov, Elements of applied bifurcation
theory, chapter 10.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from ... import backend
from ...errors import InputError, MbdaeError
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.equations.symmetry import Symmetry
from ...system import Array
from ...tolerances import EVALUATION_ROUNDING, HALF_DIGITS, INTERPOLATION, SMALLEST_PART
from ..factories import ParametricFactory
from ..path_location import locate
from .grazing import GrazingMonitor
from .motion import motion_of
from .period import period_of_functions
from .result import Bifurcation, BranchMotion
from .shooting.exchange import Exchange
from .shooting.flow import Flow
from .shooting.shooting_equations import Cycle, Guess, ShootingEquations

FIRST_STEP, MAX_STEP, MIN_STEP = 0.02, 0.1, SMALLEST_PART  # in rad, characteristic lengths, fractions of the range
MAX_POINTS, MAX_CORRECTIONS, MAX_HALVINGS, GROWTH, MIN_COSINE = 500, 8, 10, 1.5, 0.9


class Range(NamedTuple):
    """A parameter and its range."""

    name: str
    first: float
    last: float


class BranchPath:
    """The equations of a periodic motion over a parameter.

    Args:
        factory: factory of the mechanisms.
        parameter: name and range of the parameter.
        constants: further parameters, constant.
        options: options of the runs.
        tolerance: tolerance of the residual.
    """

    def __init__(
        self,
        factory: ParametricFactory,
        parameter: Range,
        constants: Mapping[str, Any],
        options: Mapping[str, Any],
        tolerance: float,
    ) -> None:
        self.factory, self.parameter, self.constants = factory, parameter, constants
        self.options, self.tolerance = options, tolerance

    def flow(self, value: float, t: float, y: Array, mode: tuple[int, ...] = ()) -> Flow:
        """Return the runs at a value of the parameter, with accurate derivatives at a point, in a mode.

        Raises:
            UnknownNameError, InputError: for an invalid value.
        """
        name = self.parameter.name

        def make(values: Mapping[str, float]) -> Any:
            return self.factory.make({**self.constants, **values})

        mech = make({name: value})
        q, v, s, _ = np.split(y, np.cumsum([mech.nq, mech.nv, len(mech.states)]))
        points = [(t, q, v, s, mode or (0,) * len(mech.switches))]
        parameters = Parameters(make, {name: value}, backend.load(), along=points)
        return Flow(parameters.mech, parameters, self.options)

    def equations(self, cycle: Cycle, guess: Guess, value: float) -> ShootingEquations:
        """Return the equations at a guess, with consistent nodes, and a value of the parameter.

        Raises:
            MbdaeError: if nodes cannot be made consistent, or the runs fail.
        """
        flow, T, by_value = self.flow(value, cycle.t, guess.nodes[0], *guess.modes[:1]), guess.T, 0.0
        if cycle.periods:
            (low, high), h = sorted(self.parameter[1:]), INTERPOLATION * abs(self.parameter.last - self.parameter.first)
            # values outside the range may be invalid
            low, high = max(value - h, min(value, low)), min(value + h, max(value, high))
            T, before, after = (cycle.periods * self.period(x) for x in (value, low, high))
            by_value = (after - before) / (high - low)
        system = flow.mechanism.system()
        symmetries = Symmetry.named(system, [x.name for x in cycle.symmetries])
        nodes = []
        for i, y in enumerate(guess.nodes):
            system.enter(guess.modes[i] if guess.modes else system.mode)
            system.derivative(cycle.t, y)
            nodes.append(system.project_state(cycle.t + T * i / cycle.segments, y))
        guess = replace(guess, nodes=nodes, T=T, dT_dp=by_value)
        return ShootingEquations(system, flow, replace(cycle, symmetries=symmetries), guess)

    def period(self, value: float) -> float:
        """Return the period of functions of time at a value of the parameter.

        Raises:
            InputError: if the period is not known.
        """
        return period_of_functions(self.factory.make({**self.constants, self.parameter.name: value}))

    def scales(self, shooting: ShootingEquations) -> Array:
        """Return the scales of the unknowns: 1, T, 1, and the range of the parameter."""
        out = np.ones(shooting.matrix.shape[1])
        if shooting.cycle.unknown_period:
            out[shooting.n * shooting.cycle.segments] = shooting.guess.T
        out[-1] = self.parameter.last - self.parameter.first
        return out

    def point(self, shooting: ShootingEquations, before: BranchMotion | None) -> BranchMotion:
        """Return a point of the branch; its tangent is directed as the previous one, or with increasing parameter."""
        value = shooting.flow.parameters.values[self.parameter.name]
        x = np.linalg.svd(shooting.matrix * self.scales(shooting))[2][-1]
        direction = self.transport_tangent(shooting, before) if before else np.eye(len(x))[-1]
        x *= 1.0 if x @ direction >= 0 else -1.0
        return BranchMotion(value, motion_of(shooting), self.tangent_at_nodes(shooting, x))

    def tangent_at_nodes(self, shooting: ShootingEquations, x: Array) -> tuple[Array, Array]:
        """Return a tangent as derivatives of the nodes, (k, ny), and of the remaining unknowns, (m,)."""
        k, n = shooting.cycle.segments, shooting.n
        nodes = np.array([lift @ x[i * n : (i + 1) * n] for i, lift in enumerate(shooting.lifts)])
        return nodes, x[n * k :]

    def transport_tangent(self, shooting: ShootingEquations, point: BranchMotion) -> Array:
        """Return the unit tangent of a point in the local coordinates of equations at a neighbouring point."""
        nodes, unknowns = point.tangent
        blocks = [
            chart.coordinate_tangents(y, dy[:, None])[:, 0]
            for chart, y, dy in zip(shooting.charts, shooting.guess.nodes, nodes, strict=True)
        ]
        x = np.concatenate([*blocks, unknowns])
        return np.asarray(x / np.linalg.norm(x))

    def step(self, start: BranchMotion, h: float) -> BranchMotion | None:
        """Return the point after a step of length h; None if it fails, or the tangent turns too much."""
        found = self.point_on_plane(start, h)
        if found is None:
            return None
        shooting = found.motion.shooting
        cosine = self.transport_tangent(shooting, start) @ self.transport_tangent(shooting, found)
        return found if cosine >= MIN_COSINE else None

    def point_on_plane(self, start: BranchMotion, h: float) -> BranchMotion | None:
        """Return the point of the branch on the normal plane at distance h along the tangent; None if it fails."""
        shooting = start.motion.shooting
        try:
            x = self.transport_tangent(shooting, start) * self.scales(shooting)
            end = self.equations(shooting.cycle, shooting.guess_after(h * x[:-1]), start.value + h * float(x[-1]))
            return self.correct(end, start)
        except (MbdaeError, np.linalg.LinAlgError):
            return None

    def correct(self, shooting: ShootingEquations, before: BranchMotion) -> BranchMotion | None:
        """Return the point of the branch on a plane normal to the previous tangent; None if Newton's method fails."""
        last = np.inf
        for _ in range(MAX_CORRECTIONS):
            if shooting.size <= EVALUATION_ROUNDING or (shooting.size <= self.tolerance and shooting.size > last / 2):
                break
            last, scales, direction = shooting.size, self.scales(shooting), self.transport_tangent(shooting, before)
            right = np.zeros(len(shooting.matrix) + 1)
            right[: len(shooting.residual)] = -shooting.residual
            x = np.linalg.lstsq(np.vstack([shooting.matrix * scales, direction]), right)[0] * scales
            value = shooting.flow.parameters.values[self.parameter.name] + float(x[-1])
            shooting = self.equations(shooting.cycle, shooting.guess_after(x[:-1]), value)
        return self.point(shooting, before) if shooting.size <= self.tolerance else None

    def run(self, first: BranchMotion, h: float = FIRST_STEP) -> tuple[list[BranchMotion], list[Bifurcation], str]:
        """Follow a branch from a point to the end of the range; return points, bifurcations and why it ended early."""
        start, points, found, monitor = first, [first], list[Bifurcation](), GrazingMonitor(first)
        name, (low, high) = self.parameter.name, sorted(self.parameter[1:])
        while len(points) < MAX_POINTS:
            end = (self.point_on_plane if monitor.passing else self.step)(start, h)
            if end is None:
                h /= 2
                if h < MIN_STEP:
                    return points, found, f"ends at {name} = {start.value:.9g}: no motion is found beyond"
                continue
            if ended := not low <= end.value <= high:
                h, end = self.locate_zero(start, h, partial(_beyond, low if end.value < low else high))
            found += [] if monitor.passing else self.bifurcations(start, end, h)
            points.append(end)
            if ended:
                return points, found, ""
            if grazing := monitor.grazing(end, h):
                found.append(grazing)
                if monitor.terminal:
                    return points, found, f"ends where {grazing.grazed!r} is grazed: there is no derivative beyond"
                h = FIRST_STEP  # crosses the corner of the branch
            start, h = end, monitor.limit_step(min(MAX_STEP, GROWTH * h))
        return points, found, f"ends at {name} = {start.value:.9g} after {MAX_POINTS} points"

    def locate_zero(
        self, start: BranchMotion, h: float, value: Callable[[BranchMotion], float]
    ) -> tuple[float, BranchMotion]:
        """Return the step length at a sign change of a value, and the point."""
        return locate(self.point_on_plane, start, h, value, "periodic motions")  # `step` would reject h at a corner

    def bifurcations(self, start: BranchMotion, end: BranchMotion, h: float) -> list[Bifurcation]:
        """Return the bifurcations of a step, in order."""
        out = list[tuple[float, Bifurcation]]()
        crossed = [kind for kind, test in TESTS.items() if test(start) * test(end) < 0]
        if "fold" in crossed:
            crossed = [kind for kind in crossed if kind != "branch"]
        for kind in crossed:
            length, point = self.locate_zero(start, h, TESTS[kind])
            if kind != "neimark-sacker" or _has_complex_pair(point.motion.multipliers):
                out.append((length, Bifurcation(kind, point.value, point.motion)))
        return [x for _, x in sorted(out, key=lambda pair: pair[0])]

    def doubled(self, doubling: Bifurcation, h: float) -> tuple[list[BranchMotion], list[Bifurcation], str]:
        """Follow the branch of twice the period from a period doubling; see `mbdae.studies.periodic.branch`.

        Raises:
            InputError: if no motion of twice the period is found.
        """
        base, k = doubling.motion.shooting, doubling.motion.shooting.cycle.segments
        P = base.cycle.exchange  # two exchanges cancel; in the second half, joints are exchanged
        periods = 2 * base.cycle.periods
        cycle = replace(base.cycle, segments=2 * k, exchange=Exchange(base.flow.mechanism), periods=periods)
        nodes = [*base.guess.nodes, *(P.of_state(y) for y in base.guess.nodes)]
        g, modes = base.guess, () if P else 2 * base.modes
        guess = replace(g, nodes=nodes, modes=modes, T=2 * g.T, sigma=2 * g.sigma, shifts=2 * g.shifts)
        product = np.linalg.multi_dot([*base.factors[::-1], np.eye(base.n)])
        values, vectors = np.linalg.eig(product)
        x = vectors[:, np.abs(values + 1).argmin()].real
        flips = []
        for M, lift in zip(base.factors, base.lifts, strict=True):
            flips.append(lift @ x)
            x = M @ x
        double = self.equations(cycle, guess, doubling.value)
        flips += [-P.tangent @ dy for dy in flips]
        tangent = np.zeros(double.matrix.shape[1])
        pairs = zip(double.charts, double.guess.nodes, flips, strict=True)
        tangent[: 2 * k * base.n] = np.concatenate([c.coordinate_tangents(y, dy[:, None])[:, 0] for c, y, dy in pairs])
        tangent /= np.linalg.norm(tangent)
        first = BranchMotion(doubling.value, motion_of(double), self.tangent_at_nodes(double, tangent))
        low, high = sorted(self.parameter[1:])
        for _ in range(MAX_HALVINGS):
            start = self.point_on_plane(first, h)  # the parameter changes by O(h^2)
            if start and low <= start.value <= high:
                points, found, message = self.run(start)
                return [first, *points], found, message
            h /= 2
        raise InputError(f"no motion of twice the period is found near {self.parameter.name} = {doubling.value:.9g}")


def _beyond(limit: float, p: BranchMotion) -> float:
    return p.value - limit


def _pairs(p: BranchMotion) -> float:
    return float(np.prod([a * b - 1 for a, b in combinations(p.motion.multipliers, 2)]).real)


def _has_complex_pair(multipliers: Array) -> bool:
    """Return whether a complex pair of multipliers has magnitude 1, in contrast to two real ones with product 1."""
    z = multipliers[np.abs(np.abs(multipliers) - 1) < HALF_DIGITS**0.5]
    return bool(len(z) and np.abs(z.imag).max() > HALF_DIGITS**0.5)


TESTS: dict[str, Callable[[BranchMotion], float]] = {
    "fold": lambda p: float(p.tangent[1][-1]),
    "doubling": lambda p: float(np.prod(p.motion.multipliers + 1).real),
    "neimark-sacker": _pairs,
    "branch": lambda p: float(np.prod(p.motion.multipliers - 1).real),
}
