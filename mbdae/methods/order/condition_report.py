"""Results of the order conditions of a tableau, see `mbdae.methods.order.conditions`."""

from dataclasses import asdict, dataclass

from ...data_types import JsonObject
from .assumptions import Assumptions


@dataclass(frozen=True)
class Failure:
    """A violated condition: the elementary weight ``left`` of a tree is not ``right`` = 1/gamma."""

    tree: str
    order: int
    left: str
    right: str
    residual: float

    def __str__(self) -> str:
        return f"{self.tree} has {self.left}, not {self.right} (residual {self.residual:+.3g})"


@dataclass(frozen=True)
class Check:
    """Result for one kind of conditions: all hold up to ``order``.

    Attributes:
        order: the order found.
        trees: number of conditions up to this order.
        residual: the largest residual among them; 0 unless coefficients are rounded.
        failure: the first condition that fails at the next order; None if no higher order was checked.
    """

    order: int
    trees: int
    residual: float
    failure: Failure | None

    def __str__(self) -> str:
        counted = f"{self.order} ({self.trees} conditions" + (f", to {self.residual:.0e})" if self.residual else ")")
        return f"{counted}; then {self.failure}" if self.failure else f"{counted}; nothing higher was tried"


@dataclass(frozen=True)
class Embedded:
    """Orders of an embedded formula, without and with projection onto 0 = g along f_z(y_1, z_1).

    Attributes:
        name: ``"b_embedded"`` or ``"b_companion"``.
        used: the check, of the four below, that applies to the method (for general f).
    """

    name: str
    used: Check
    y: Check
    y_linear: Check
    projected: Check
    projected_linear: Check


@dataclass(frozen=True)
class ConditionReport:
    """Results of the order conditions of a tableau, and its claimed orders.

    Attributes:
        name: name of the method.
        y: conditions of y for general f.
        y_linear: conditions of y that remain when f is linear in z.
        own: conditions of the z of the method.
        ode: conditions of y without constraints, of a half-explicit method.
        normal: conditions of the error along f_z, which y does not contain, if the step does not end at a stage.
        normal_linear: conditions of this error that remain when f is linear in z.
        growth: R(infinity) of an implicit method, the growth factor of errors along f_z.
        w_last_1: growth factor per step of the error of the carried z; None if nothing is carried.
        assumptions: the simplifying assumptions that hold.
        embedded: one entry for each embedded formula.
        claims: claims of order, order_linear, order_own, order_embedded, and order_ode of a half-explicit method.
        tolerance: residuals up to this count as zero; 0 for exact coefficients.
    """

    name: str
    y: Check
    y_linear: Check
    own: Check
    w_last_1: float | None
    assumptions: Assumptions
    embedded: tuple[Embedded, ...]
    claims: dict[str, int]
    tolerance: float
    ode: Check | None = None
    normal: Check | None = None
    normal_linear: Check | None = None
    growth: float | None = None

    @property
    def order_y(self) -> int:
        """Order of y for general f."""
        return self._order(self.y, self.normal)

    @property
    def order_y_linear(self) -> int:
        """Order of y for f linear in z."""
        return self._order(self.y_linear, self.normal_linear)

    def _order(self, y: Check, normal: Check | None) -> int:
        return y.order if normal is None else min(y.order, normal.order + (self.growth != 1)) * self.stable

    @property
    def order_own(self) -> int:
        """Order of the z of the method, at most that of y; 0 if it does not converge."""
        if self.normal is None:
            return min(self.own.order, self.y.order)
        accumulated = self.growth == 1  # local errors add up; in z those of y add up even if their signs alternate
        loss = 0 if abs(self.growth or 0) < 1 else 1 + accumulated
        return max(0, min(self.own.order - accumulated, self.normal.order - loss)) * self.stable

    @property
    def order_embedded(self) -> int:
        """Order of the embedded formula as used by the method; 0 without one."""
        return self.embedded[0].used.order if self.embedded else 0

    @property
    def stable(self) -> bool:
        """Whether errors of a carried z are damped, |w_n1| < 1, and those of an implicit method do not grow."""
        return (self.w_last_1 is None or abs(self.w_last_1) < 1) and abs(self.growth or 0) <= 1

    @property
    def holds(self) -> bool:
        """Whether every claimed order is reached, and the carried z is stable."""
        orders = {"order": self.order_y, "order_linear": self.order_y_linear, "order_own": self.order_own}
        orders["order_embedded"] = self.order_embedded
        if self.ode:
            orders["order_ode"] = self.ode.order
        return self.stable and all(orders[name] >= claim for name, claim in self.claims.items())

    def __str__(self) -> str:
        rounded = f" (rounded coefficients: residuals up to {self.tolerance:g} count as zero)"
        lines = [
            f"{self.name}: its claims {'hold' if self.holds else 'DO NOT HOLD'}" + rounded * (self.tolerance > 0),
            f"  y, any f            claimed {self.claims['order']}, found {self.y}",
            f"  y, f linear in z    claimed {self.claims['order_linear']}, found {self.y_linear}",
            f"  own z               claimed {self.claims['order_own']}, found {self.own}",
        ]
        if self.ode and self.claims["order_ode"] != self.claims["order"]:
            lines.append(f"  y, no constraints   claimed {self.claims['order_ode']}, found {self.ode}")
        if self.w_last_1 is not None:
            damping = "damped" if self.stable else "NOT DAMPED"
            lines.append(f"  carried z           its error is {damping}, factor {self.w_last_1:.4g} per step")
        if self.normal is not None:
            damping = "damped" if abs(self.growth or 0) < 1 else "NOT DAMPED: |R(infinity)| < 1 is violated"
            lines += [
                f"  error along f_z     order {self.normal}; it is {damping}",
                f"  together            y {self.order_y}, f linear in z {self.order_y_linear}, own z "
                + (str(self.order_own) if self.order_own else "does not converge"),
            ]
        for formula in self.embedded:
            lines.append(f"  {formula.name:<19} claimed {self._claim(formula)}, found {formula.used}")
            if formula.used is formula.projected:
                lines.append(f"                      after projection; without it {formula.y}")
        assumptions = str(self.assumptions)
        if self.growth is not None:
            assumptions = f"{self.assumptions.implicit}, R(infinity) = {self.growth:g}"
        return "\n".join([*lines, f"  {assumptions}"])

    def _claim(self, formula: Embedded) -> int:
        return self.claims["order_embedded"] - (formula.name == "b_companion")

    def to_dict(self) -> JsonObject:
        """Return the report as JSON data."""
        orders = ("order_y", "order_y_linear", "order_own", "order_embedded", "stable", "holds")
        return asdict(self) | {name: getattr(self, name) for name in orders}
