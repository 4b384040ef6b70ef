"""Symmetric compositions of RATTLE: symplectic methods of orders 2, 4, 6 and 8 for mechanisms, with fixed steps.

A step of size h consists of RATTLE steps of sizes gamma_i h. With constant steps the energy of a conservative mechanism
stays within bounds over long times, whereas that of other methods drifts.

The weights of orders 6 and 8 are those of Kahan and Li, refined from 20 to 32 digits by Newton's method on the order
conditions, `mbdae.methods.order.composition`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..errors import InputError, StepError
from ..system import Array, State, Step, System, VariationalStep
from ..tolerances import BELOW_ROUNDING, ITERATION_ROUNDING
from .controller import PI
from .exact_numbers import exact, row
from .tableau import Row, Text

MAX_ITERATIONS = 30
TYPICAL_EVALUATIONS = 4  # evaluations of the equations in a step of RATTLE
SLOWEST_RATE = 0.5  # contraction rate of Newton's method: at higher rates, small changes are rounding errors


class NewtonMethod:
    """A method whose steps are solved by Newton's method to rounding."""

    name: str
    in_core = True  # the compiled core takes its steps
    control, blend, noise = PI, 1.0, 0.0

    def min_growth(self, ny: int) -> float:
        """Return 1: no growth of h is suppressed, as each step has its own partials and factors."""
        return 1.0

    def iteration(self, native: Any) -> Any:
        """Return the thresholds of Newton's method for the compiled core."""
        return native.NewtonIteration(
            max_iterations=MAX_ITERATIONS,
            below_rounding=BELOW_ROUNDING,
            iteration_rounding=ITERATION_ROUNDING,
            slowest_rate=SLOWEST_RATE,
        )


@dataclass(frozen=True)
class Composition(NewtonMethod):
    """Weights of a symmetric composition of RATTLE steps.

    Args:
        name: name typed by the user.
        title: one line for a list of methods.
        reference: where the weights were published.
        half: gamma_1 up to the middle gamma_i, as text; the remaining ones follow by symmetry.
        order: claimed order of q and v.
    """

    name: str
    title: str
    reference: str
    half: Text = field(repr=False)
    order: int

    family = "RATTLE"
    order_own = 1
    order_embedded = error_power = 0  # no step-size control
    position_pivot = np.inf
    carries, rounded = False, True
    excludes: ClassVar[Mapping[str, str]] = {
        "textbook": "it integrates the Lagrangian of a mechanism",
        "ggl": "it enforces positions and velocities in formulation 'index2'",
        "velocity rows": "rolling and other constraints of velocities alone have no discrete Lagrangian",
        "events": "jumps of the state end steps anywhere",
        "switches": "impacts, stiction and contacts end steps anywhere, and their equations are not variational",
        "states": "states of actuators and controllers have no discrete Lagrangian",
        "closure friction": "friction proportional to multipliers has no discrete Lagrangian",
    }

    @property
    def order_linear(self) -> int:
        """Order for mechanisms, equal to `order`."""
        return self.order

    @cached_property
    def exact_weights(self) -> Row:
        """Exact gamma_i, (s,)."""
        half = [exact(x) for x in self.half]
        return half + half[-2::-1]

    @cached_property
    def weights(self) -> Array:
        """Double-precision gamma_i, (s,)."""
        return np.array(self.exact_weights, float)

    @cached_property
    def nodes(self) -> Array:
        """Start times of the substeps in units of h, and 1, (s + 1,)."""
        return np.array([sum(self.exact_weights[:i]) for i in range(len(self.exact_weights))] + [1], float)

    def compiled(self, native: Any) -> Any:
        """Return the method for the compiled core."""
        return native.Composition(weights=self.weights, nodes=self.nodes, iteration=self.iteration(native))

    @property
    def solves(self) -> int:
        """Linear solves per step with a typical number of iterations."""
        return TYPICAL_EVALUATIONS * len(self.weights)

    @property
    def smallest_pivot(self) -> float:
        """Pivot p = |gamma_s| / 2; the rounding error of the z of the method is eps / (p h).

        z is mu of the last substep, of size gamma_s h, which adds gamma_s h/2 G^T mu to the momentum.
        """
        return abs(float(self.weights[-1])) / 2

    @property
    def roundings(self) -> int:
        """Roundings of v per step that compensated summation does not remove: each substep solves for v from p."""
        return len(self.weights)

    def controlled_step(self, system: System, t: float, h: float, state: State) -> Step:
        """Reject the call: with steps of varying size, the error of the energy is not bounded.

        Raises:
            InputError: always.
        """
        raise InputError(f"method {self.name!r} takes fixed steps: give a step in place of rtol")

    def step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take the substeps of one step; its errors are empty, (0, ny).

        Raises:
            StepError: if Newton's method does not converge.
        """
        out = system.compiled_step(self, t, h, state)
        if out is None:
            for c, gamma in zip(self.nodes.tolist(), self.weights.tolist(), strict=False):
                out = rattle_step(system, t + c * h, gamma * h, state)
                state = out.state
        assert out is not None
        return out


def rattle_step(system: System, t: float, h: float, state: State) -> Step:
    """Take a step of RATTLE, with Newton's method to rounding: a looser tolerance causes a drift of the energy.

    Raises:
        StepError: if it does not converge.
    """
    step = system.variational_step(t, h, state.y)
    x, lam = solve_newton(system, step)
    return make_step(system, state, *step.end(x, lam), None)


def make_step(system: System, state: State, dy: Array, z: Array, carry: object) -> Step:
    """Return the step with the increment ``dy`` (ny,) of y, with compensated summation."""
    if state.compensation is not None:
        dy = dy + state.compensation
    y = system.add(state.y, dy)
    return Step(State(y, carry, system.rounding_loss(state.y, dy, y)), z, np.empty((0, system.ny)))


def solve_newton(system: System, step: VariationalStep) -> tuple[Array, Array]:
    """Return x and lam by Newton's method; from changes last and size, the next one is estimated as size^2 / last.

    Raises:
        StepError: if Newton's method does not converge.
    """
    x, lam = step.first_guess()
    last = 0.0
    for _ in range(MAX_ITERATIONS):
        dx, dlam = step.correction(x, lam)
        x, lam = x + dx, lam + dlam
        system.counts.newton += 1
        size, scale = step.measure(dx, x)
        if not np.isfinite(size):
            break
        rate = size / last if last else 1.0
        if rate * size <= BELOW_ROUNDING or (rate > SLOWEST_RATE and size <= ITERATION_ROUNDING * scale):
            return x, lam
        last = size
    where = f"the step of {step.h:g} s at t = {step.t:.17g}"
    raise StepError("newton", f"{where}: Newton's method does not converge, take shorter steps")


_SUZUKI = "0.414490771794375737142354062860761495711774604"
_MIDDLE = "-0.657963087177502948569416251443045982847098416"

rattle2 = Composition(
    name="rattle2",
    title="RATTLE, symplectic",
    reference="Leimkuhler, Reich, Simulating Hamiltonian Dynamics (2004), chapter 7",
    half=row("1"),
    order=2,
)
rattle4 = Composition(
    name="rattle4",
    title="RATTLE composed of 5 steps, symplectic",
    reference="M. Suzuki, Phys. Lett. A 146 (1990)",
    half=row(f"{_SUZUKI} {_SUZUKI} {_MIDDLE}"),
    order=4,
)
rattle6 = Composition(
    name="rattle6",
    title="RATTLE composed of 9 steps, symplectic",
    reference="W. Kahan, R.-C. Li, Math. Comp. 66 (1997)",
    half=row("""
        0.39216144400731413927925055518118 0.33259913678935943859974864032027 -0.70624617255763935980996481947476
        0.08221359629355080023149044744883 0.79854399093482996339895035304896
    """),
    order=6,
)
rattle8 = Composition(
    name="rattle8",
    title="RATTLE composed of 17 steps, symplectic",
    reference="W. Kahan, R.-C. Li, Math. Comp. 66 (1997)",
    half=row("""
        0.13020248308889008087881763226255 0.56116298177510838456196440770159 -0.38947496264484728640807859864594
        0.15884190655515560089621074563038 -0.39590389413323757733623153902219 0.18453964097831570709183254133857
        0.25837438768632204729397910986043 0.29501172360931029887096624049197 -0.60550853383003451169892107933472
    """),
    order=8,
)
