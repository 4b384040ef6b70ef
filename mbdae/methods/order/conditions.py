"""Order conditions of half-explicit and implicit methods, checked on the trees of index-2 theory.

With the elementary weights phi, psi of a tableau (`mbdae.methods.order.weights`) and the trees of DAT2

    y_1:    b . phi(t) = 1 / gamma(t)     for all t in DAT2_y with rho(t) <= p      gives order p of y
    method's z:  psi_n(u)   = 1 / gamma(u)     for all u in DAT2_z with rho(u) <= m - 1  gives order m of Z_n

(with p >= m, and for a carried z with |w_n1| < 1).

An implicit method whose step does not end at a stage violates 0 = g(y_1). The trees [u]_y with one fat son are the part
of its local error along f_z; let them hold up to order q, the other trees up to p, and the trees of z up to m - 1. The
error along f_z is multiplied by R(infinity) in each step, like that of z, in which it appears divided by h. Therefore

    |R(infinity)| < 1:  y min(p, q + 1),  z min(m, q)
    R(infinity) = -1:   y min(p, q + 1),  z min(m, q - 1)
    R(infinity) = 1:    y min(p, q),      z min(m - 1, q - 2)

where z of order 0 does not converge (Hairer, Wanner II, section VII.4 with table 4.1). Trees in which
a vertex has two fat sons do not occur when f is linear in z, as in mechanics. Sources: Hairer, Lubich and Roche 1989,
chapter 5; A. Murua, Computing 59 (1997).
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from math import prod

from ...errors import InputError
from ...tolerances import PUBLISHED_DECIMALS
from ..exact_numbers import Number, exact
from ..runge_kutta import RungeKutta
from ..tableau import Row, Tableau
from .assumptions import assumptions
from .condition_report import Check, ConditionReport, Embedded, Failure
from .trees import RootedTree, iterate_y, plain_trees, trees_z
from .weights import Weight, Weights

MAX_PROVEN_ORDER = 5  # highest order that is checked for a tableau without claimed orders

Trees = Callable[[int], Iterable[RootedTree]]


def check_conditions(tableau: RungeKutta, max_order: int | None = None) -> ConditionReport:
    """Check every order condition of a tableau up to one order above the claimed order.

    Args:
        tableau: the method.
        max_order: highest order to check, which may be too low to confirm a claim; each claim plus one if left out.

    Returns:
        The orders found, the first condition that fails above each, and the simplifying assumptions.
    """
    weights, b = Weights(tableau), tableau.exact_b
    tolerance = PUBLISHED_DECIMALS if tableau.rounded else 0.0

    def search(weight: Weight, trees: Trees, highest: int) -> Check:
        return _search(weight, trees, max_order or highest, tolerance)

    def embedded(name: str, row: Row) -> Embedded:
        unprojected, projected_weight = weights.sums(row), _projected(weights, b, row)
        checks = [
            search(f, trees, tableau.order) for f in (unprojected, projected_weight) for trees in (iterate_y, _linear_y)
        ]
        return Embedded(name, checks[2 if tableau.project_embedded else 0], *checks)

    at_stage = b in tableau.exact_Ahat
    weight, own_weight = weights.sums(b), weights.last if at_stage else weights.sums_at_end(b)
    own = _search(own_weight, trees_z, max_order - 1 if max_order else tableau.order_own + (not at_stage), tolerance)
    rows = {"b_embedded": tableau.b_embedded, "b_companion": tableau.b_companion}
    claims = ["order", "order_linear", "order_own", "order_embedded"]
    ode = None
    if isinstance(tableau, Tableau):
        ode = search(weight, plain_trees, tableau.order_ode + 1)
        claims.append("order_ode")

    def conditions(trees: Trees, order: int) -> tuple[Check, Check | None]:
        """Check all trees; separately those of the error along f_z, if it remains at the end of a step."""

        def along_fz(normal: bool) -> Trees:
            return lambda n: (t for t in trees(n) if normal == (not t.sons_y and len(t.sons_z) == 1))

        if at_stage:
            return search(weight, trees, order + 1), None
        return search(weight, along_fz(False), order + 1), search(weight, along_fz(True), order + 1)

    (y, normal), (y_linear, normal_linear) = (
        conditions(iterate_y, tableau.order),
        conditions(_linear_y, tableau.order_linear),
    )
    return ConditionReport(
        name=tableau.name,
        y=y,
        y_linear=y_linear,
        ode=ode,
        normal=normal,
        normal_linear=normal_linear,
        growth=None if isinstance(tableau, Tableau) else float(tableau.R_infinity),
        own=Check(own.order + 1, own.trees, own.residual, own.failure),
        w_last_1=float(weights.W[-1][0]) if tableau.explicit_first and at_stage else None,
        assumptions=assumptions(tableau),
        embedded=tuple(embedded(name, [exact(x) for x in row]) for name, row in rows.items() if row),
        claims={key: getattr(tableau, key) for key in claims},
        tolerance=tolerance,
    )


def with_proven_orders(tableau: Tableau) -> Tableau:
    """Complete a tableau without claims by the orders that the conditions prove, up to `MAX_PROVEN_ORDER`.

    Raises:
        InputError: for a tableau of order 0.
    """
    weights, b, tolerance = Weights(tableau), tableau.exact_b, PUBLISHED_DECIMALS if tableau.rounded else 0.0

    def proven_order(row: Row, trees: Trees) -> int:
        return _search(weights.sums(row), trees, MAX_PROVEN_ORDER, tolerance).order

    order = proven_order(b, iterate_y)
    if not order:
        raise InputError(f"tableau {tableau.name!r}: its weights b must add up to 1")
    embedded = tableau.order_embedded
    if tableau.b_embedded and not embedded:
        embedded = proven_order([exact(x) for x in tableau.b_embedded], _linear_y)
    return replace(
        tableau,
        order=order,
        order_linear=proven_order(b, _linear_y),
        order_ode=proven_order(b, plain_trees),
        order_own=1 + _search(weights.last, trees_z, order - 1, tolerance).order,
        order_embedded=embedded,
    )


def _search(weight: Weight, trees: Trees, highest: int, tolerance: float) -> Check:
    """Check the conditions weight(t) = 1 / gamma(t) order by order until one fails."""
    checked, largest = 0, 0.0
    for order in range(1, highest + 1):
        passed = checked
        for tree in trees(order):
            residual = float(weight(tree) - 1 / tree.gamma)
            if abs(residual) > tolerance:
                failure = Failure(str(tree), order, _short(weight(tree)), str(1 / tree.gamma), residual)
                return Check(order - 1, passed, largest, failure)
            checked, largest = checked + 1, max(largest, abs(residual))
    return Check(highest, checked, largest, None)


def _linear_y(order: int) -> Iterable[RootedTree]:
    return (t for t in iterate_y(order) if t.linear)


def _projected(weights: Weights, b: Row, row: Row) -> Weight:
    """Return elementary weights of y_0 + h sum row_i F_i + h f_z(y_1, z_1) mu, with mu from 0 = g.

    The last term adds, for every fat son u_j of the root, the product over the other sons at (y_1, Z_n) times the
    weight of u_j in mu; by 0 = g, the weight of [u]_y, u = [t_1..]_z, is the product of those of the t_i.
    """
    row_weight, end_weight = weights.sums(row), weights.sums(b)

    @cache
    def projected_weight(tree: RootedTree) -> Number:
        value = row_weight(tree)
        for j, u in enumerate(tree.sons_z):
            factors = [end_weight(t) for t in tree.sons_y]
            factors += [weights.last(x) for x in tree.sons_z[:j] + tree.sons_z[j + 1 :]]
            value = value + prod(factors, start=Fraction(1)) * multiplier_weight(u)
        return value

    @cache
    def multiplier_weight(u: RootedTree) -> Number:
        return prod((projected_weight(t) for t in u.sons_y), start=Fraction(1)) - row_weight(u)

    return projected_weight


def _short(x: Number) -> str:
    return str(x) if len(str(x)) <= 40 else f"{float(x):.12g}"
