"""Claims of every tableau: order conditions hold as claimed and fail at the next order, exactly."""

import json
from dataclasses import replace
from fractions import Fraction
from functools import cache

import pytest

from mbdae import errors
from mbdae.methods import METHODS, method
from mbdae.methods.exact_numbers import Surd, exact
from mbdae.methods.order.conditions import check_conditions
from mbdae.methods.tableau import Tableau

TABLEAUS = {name: m for name, m in METHODS.items() if isinstance(m, Tableau)}
every = pytest.mark.parametrize("name", TABLEAUS)


@cache
def report(name):
    return check_conditions(TABLEAUS[name])


@every
def test_conditions_hold_as_claimed_and_fail_at_the_next_order(name):
    tableau, found = TABLEAUS[name], report(name)
    for check, claim in (
        (found.y, tableau.order),
        (found.y_linear, tableau.order_linear),
        (found.own, tableau.order_own),
    ):
        assert check.order == claim
        assert check.failure is not None
        assert check.failure.order == claim + (check is not found.own)
        assert check.residual <= found.tolerance
        assert abs(check.failure.residual) > 1e-6
    assert found.tolerance == (1e-20 if tableau.rounded else 0)
    assert found.stable
    assert found.holds


@every
def test_number_of_conditions(name):
    counted = [1, 3, 22, 192, 1972, 22057]
    assert report(name).y.trees == sum(counted[: TABLEAUS[name].order])


@pytest.mark.parametrize("name", [n for n, m in TABLEAUS.items() if m.b_embedded])
def test_embedded_formulas(name):
    tableau, found = TABLEAUS[name], report(name)
    formula, *companion = found.embedded
    assert found.order_embedded == tableau.order_embedded == formula.used.order < tableau.order
    assert tableau.error_power == tableau.order_embedded + 1 + len(companion) <= tableau.order
    assert formula.used is (formula.projected if tableau.project_embedded else formula.y)
    assert formula.projected.order == formula.used.order
    if tableau.project_embedded:
        assert formula.y.order < formula.used.order
    assert [c.used.order for c in companion] == [tableau.order_embedded - 1] * len(companion)
    assert [len(row) for row in tableau.arrays.e] == [len(tableau.A)] * len(found.embedded)


@pytest.mark.parametrize("name", [n for n, m in TABLEAUS.items() if m.b_embedded])
def test_embedded_error_sees_a_pure_quadrature(name):
    tableau = TABLEAUS[name]
    c = [sum(row, start=Fraction(0)) for row in tableau.exact_A]
    for k, weights in enumerate((tableau.b_embedded, tableau.b_companion)):
        if weights:
            power = tableau.order_embedded - k
            value = sum(float(exact(w) * x_power(x, power)) for w, x in zip(weights, c, strict=False))
            assert abs(value - 1 / (power + 1)) > 1e-4


def x_power(x, k):
    return x_power(x, k - 1) * x if k else Fraction(1)


def test_simplifying_assumptions():
    p5, p6 = report("pherk5").assumptions, report("pherk6").assumptions
    assert (p5.B, p5.D, p5.C[2:6], min(p5.Chat)) == (5, 1, (3, 3, 3, 3), 3)
    assert (p6.B, p6.D, p6.C[2:7], min(p6.Chat)) == (6, 1, (3, 3, 3, 3, 3), 3)
    for name in ("pherk3", "pherk4", "pherk5", "pherk6"):
        tableau = METHODS[name]
        c_2, chat_2 = tableau.exact_A[1][0], sum(tableau.exact_Ahat[1])
        assert chat_2 == 3 * c_2 / 2


def test_pherk6_is_built_as_its_docstring_says():
    tableau = METHODS["pherk6"]
    A, Ahat, b = tableau.exact_A, tableau.exact_Ahat, tableau.exact_b
    c, chat = ([sum(row) for row in M] for M in (A, Ahat))
    n = len(b)
    # beta Ahat = b (1 - c) on the columns 2..6, solved from the last column backwards; beta_7 = beta_8 = 0
    beta = [Fraction(0)] * n
    for j in range(5, 0, -1):
        known = sum(beta[i] * Ahat[i][j] for i in range(j + 1, n))
        beta[j] = (b[j] * (1 - c[j]) - known) / Ahat[j][j]
    moments = [sum(w * x**k for w, x in zip(beta, chat, strict=True)) for k in range(2, 6)]
    assert moments == [Fraction(1, k + 1) for k in range(2, 6)]
    for j in range(n):
        assert sum(beta[i] * chat[i] * Ahat[i][j] for i in range(n)) == b[j] * (1 - c[j] ** 2) / 2
    assert sum(beta[i] * chat[i] ** 2 * Ahat[i][1] for i in range(n)) == 0
    assert [sum(b[i] * c[i] ** k * A[i][1] for i in range(n)) for k in range(3)] == [0, 0, 0]
    assert (b[1], c[6], chat[1], chat[3], chat[5]) == (0, 1, c[2], c[3], (1 + c[5]) / 2)
    assert c[3] == c[2] / (2 - 10 * c[2] + 15 * c[2] ** 2)
    assert min(b) >= 0
    assert max(abs(x) for M in (A, Ahat) for row in M for x in row) < Fraction(13, 10)


@every
def test_a_damaged_coefficient_is_found(name):
    tableau = TABLEAUS[name]
    if name == "herk1":
        damaged = replace(tableau, b=("1001/1000",))
    else:
        rows = list(tableau.A)
        rows[1] = (f"{rows[1][0]}+1/1000000",)
        damaged = replace(tableau, A=tuple(rows))
    assert not check_conditions(damaged).holds


def test_every_coefficient_of_pherk4_matters():
    tableau = METHODS["pherk4"]
    for key, last in (("A", 5), ("Ahat", 5)):
        for i in range(1, last):
            for j in range(len(getattr(tableau, key)[i])):
                rows = [list(r) for r in getattr(tableau, key)]
                rows[i][j] += "+1/1000"
                changes = {key: tuple(map(tuple, rows))}
                if key == "Ahat" and i == 3:
                    changes["b"] = changes["Ahat"][3]
                assert not check_conditions(replace(tableau, **changes)).holds, (key, i, j)


def plain_order(A, b, highest):
    """Order for y' = f(y) by nested lists of children, independent of the trees under test."""

    def trees(order):
        if order == 1:
            return {()}
        grown = set()
        for tree in trees(order - 1):
            grown |= {tuple(sorted(t)) for t in leaves_added(tree)}
        return grown

    def leaves_added(tree):
        yield (*tree, ())
        for i, son in enumerate(tree):
            for new in leaves_added(son):
                yield (*tree[:i], tuple(sorted(new)), *tree[i + 1 :])

    def vertices(tree):
        return 1 + sum(map(vertices, tree))

    def density(tree):
        value = vertices(tree)
        for son in tree:
            value *= density(son)
        return value

    def stages(tree):
        out = [Fraction(1)] * len(A)
        for son in tree:
            inner = stages(son)
            out = [
                o * sum((a * x for a, x in zip(r, inner, strict=True)), Fraction(0))
                for o, r in zip(out, A, strict=True)
            ]
        return out

    for order in range(1, highest + 1):
        for tree in trees(order):
            value = sum((w * x for w, x in zip(b, stages(tree), strict=True)), Fraction(0))
            if abs(float(value - Fraction(1, density(tree)))) > 1e-20:
                return order - 1
    return highest


@every
def test_order_of_the_explicit_part(name):
    tableau = TABLEAUS[name]
    assert plain_order(tableau.exact_A, tableau.exact_b, 7) == tableau.order_ode == report(name).ode.order


def test_order_reduction_is_reported():
    assert "y, no constraints   claimed 4, found 4" in str(report("rk4"))
    assert "no constraints" not in str(report("pherk5"))
    assert not check_conditions(replace(METHODS["herk2"], order=100_000)).holds  # at once
    assert not check_conditions(replace(METHODS["rk4"], order_ode=5)).holds
    own = method(replace(METHODS["rk4"], name="rk4_without_claims", order=0, order_linear=0, order_own=0, order_ode=0))
    assert (own.order, own.order_linear, own.order_ode) == (2, 3, 4)


def test_report_is_readable_and_plain():
    text = str(report("pherk5"))
    assert "pherk5: its claims hold" in text
    assert "after projection" in text
    assert "rounded" in str(report("herk5"))
    assert json.loads(json.dumps(report("herk4").to_dict()))["order_y"] == 4
    low = check_conditions(METHODS["pherk5"], max_order=3)
    assert (low.order_y, low.order_own, low.y.failure) == (3, 3, None)
    assert not low.holds
    assert "nothing higher was tried" in str(low)
    unstable = replace(METHODS["pherk4"], order=5)
    assert "DO NOT HOLD" in str(check_conditions(unstable))


def test_methods_are_found_by_name():
    assert {"herk3", "pherk5", "hedop5", "rk4", "radau5"} < set(METHODS)
    assert list(METHODS) == sorted(METHODS)
    assert all(method(name).name == name for name in METHODS)
    with pytest.raises(errors.UnknownNameError, match="valid: alpha, alpha_i3, arnold4, gauss2") as caught:
        method("pherk7")
    assert caught.value.valid == tuple(METHODS)


def test_exact_numbers():
    x = exact("1/6 - sqrt(3)/108")
    assert x == Surd(Fraction(1, 6), Fraction(-1, 108), 3)
    assert x - x == 0
    assert x / x == 1
    assert exact("-0.125") == Fraction(-1, 8)
    assert float(1 / exact("sqrt(2)")) == pytest.approx(0.5**0.5)
    for text in ("1/3*x", "sqrt(4)", "2**3", "f(2)"):
        with pytest.raises(ValueError, match="not an exact number"):
            exact(text)
    with pytest.raises(ValueError, match="cannot mix"):
        exact("sqrt(2)+sqrt(3)")


def test_a_tableau_checks_itself():
    with pytest.raises(ValueError, match="'bad'"):
        Tableau(
            name="bad", title="", reference="", A=(("0",), ("0",)), b=("1/2", "1/2"), order=1, order_own=1
        )
