"""Nodes, coefficients and order conditions of the Radau IIA methods, to 40 digits."""

from dataclasses import replace
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest

from mbdae import METHODS, errors
from mbdae.methods import method
from mbdae.methods.exact_numbers import exact
from mbdae.methods.order.conditions import check_conditions
from mbdae.methods.radau import MAX_STAGES, RadauIIA
from mbdae.methods.radau_coefficients import coefficients
from mbdae.methods.stage_arrays import lagrange

PRINTED = {  # Hairer, Wanner II, tables IV.5.5 and IV.5.6, and implicit Euler
    1: [["1"]],
    2: [["5/12", "-1/12"], ["3/4", "1/4"]],
    3: [
        ["11/45 - 7*sqrt(6)/360", "37/225 - 169*sqrt(6)/1800", "-2/225 + sqrt(6)/75"],
        ["37/225 + 169*sqrt(6)/1800", "11/45 + 7*sqrt(6)/360", "-2/225 - sqrt(6)/75"],
        ["4/9 - sqrt(6)/36", "4/9 + sqrt(6)/36", "1/9"],
    ],
}
STAGES = (1, 2, 3, 4, 5, 8, MAX_STAGES)
NAMES = [name for name, m in METHODS.items() if isinstance(m, RadauIIA)]


def decimal(text):
    """The value of an exact number to 50 digits."""
    x = exact(text)
    a, b, d = (x, Fraction(0), 1) if isinstance(x, Fraction) else (x.a, x.b, x.d)
    return Decimal(a.numerator) / a.denominator + Decimal(b.numerator) / b.denominator * Decimal(d).sqrt()


@pytest.mark.parametrize("s", PRINTED)
def test_printed_tables(s):
    with localcontext() as context:
        context.prec = 50
        for row, printed in zip(coefficients(s).A, PRINTED[s], strict=True):
            for x, text in zip(row, printed, strict=True):
                assert abs(x - decimal(text)) < Decimal("2e-40")


@pytest.mark.parametrize("s", STAGES)
def test_simplifying_assumptions_hold_as_claimed_and_not_beyond(s):
    A, c = coefficients(s).A, coefficients(s).c
    b = A[-1]
    assert list(c) == sorted(c)
    assert c[0] > 0
    assert c[-1] == 1
    with localcontext() as context:
        context.prec = 60

        def B(k):
            return max(abs(sum(w * x ** (k - 1) for w, x in zip(b, c, strict=True)) - Decimal(1) / k), 0)

        def C(k):
            rows = [sum(a * x ** (k - 1) for a, x in zip(r, c, strict=True)) for r in A]
            return max(abs(value - x**k / k) for value, x in zip(rows, c, strict=True))

        def D(k):
            columns = [sum(w * x ** (k - 1) * r[j] for w, x, r in zip(b, c, A, strict=True)) for j in range(s)]
            return max(abs(u - b[j] * (1 - c[j] ** k) / k) for j, u in enumerate(columns))

        for condition, highest in ((B, 2 * s - 1), (C, s), (D, s - 1)):
            assert max((condition(k) for k in range(1, highest + 1)), default=0) < Decimal("1e-37")
            assert condition(highest + 1) > Decimal(10) ** (-2 * s)


@pytest.mark.parametrize("s", STAGES)
def test_arrays(s):
    a, rng = coefficients(s).arrays, np.random.default_rng(0)
    x = rng.standard_normal((s, 3))
    applied = sum(np.outer(m.column, m.value * (m.row @ x)) for m in a.modes).real
    identity = sum(np.outer(m.column, m.row @ x) for m in a.modes).real
    tolerance = 4e-15 * 4.0**s  # the condition of the eigenvectors
    np.testing.assert_allclose(applied, a.A @ x, rtol=0, atol=tolerance)
    np.testing.assert_allclose(identity, x, rtol=0, atol=tolerance)
    assert len(a.modes) == (s + 1) // 2
    assert all(np.real(m.value) > 0 for m in a.modes)
    assert (a.real is not None) == bool(s % 2)
    assert a.gamma > 0
    assert a.c[a.middle] == a.c[np.abs(a.c - 0.5).argmin()]
    np.testing.assert_allclose(np.linalg.solve(a.A, np.ones(s)) @ a.A[-1], 1, rtol=1e-11)  # R(infinity) = 0


def test_lagrange_polynomials():
    c, x = coefficients(4).arrays.c, np.array([-0.3, 0.0, 0.5, 1.7])
    for k in range(4):
        np.testing.assert_allclose(lagrange(c, x) @ c**k, x**k, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(np.abs(lagrange(c, c)), np.eye(4))
    first, second = coefficients(4).arrays.start
    np.testing.assert_allclose([first @ c**k for k in range(4)], [1, 0, 0, 0], rtol=0, atol=1e-14)
    np.testing.assert_allclose([second @ c**k for k in range(3)], [1, 0, 0], rtol=0, atol=1e-14)
    assert second[0] == 0
    assert abs(second @ c**3) > 0.01


@pytest.mark.parametrize("name", NAMES)
def test_index_2_conditions_hold_as_claimed_and_fail_at_the_next_order(name):
    m = METHODS[name]
    report = check_conditions(m)
    assert report.holds
    assert (report.y.order, report.y_linear.order, report.own.order) == (2 * m.stages - 1, 2 * m.stages - 1, m.stages)
    assert all(check.failure is not None for check in (report.y, report.y_linear, report.own))
    assert max(report.y.residual, report.own.residual) < 1e-35
    assert (2 * m.stages - 1, m.stages - 1) == (report.assumptions.B, report.assumptions.D)
    assert report.assumptions.C[1] == m.stages
    assert [f.used.order for f in report.embedded] == [m.stages, m.stages - 1][: len(report.embedded)]
    assert len(report.embedded) == 1 + (m.stages >= 3)
    assert m.error_power == m.stages + len(report.embedded)


def test_a_damaged_coefficient_is_found(monkeypatch):
    m = RadauIIA(3)
    rows = [list(r) for r in m.exact_A]
    rows[2][1] += Fraction(1, 10**12)
    monkeypatch.setitem(m.__dict__, "exact_A", rows)
    assert not check_conditions(m).holds


def test_methods_by_name():
    assert NAMES == ["radau1", "radau3", "radau5"]
    for s in range(1, MAX_STAGES + 1):
        m = method(f"radau{2 * s - 1}")
        assert (m.stages, m.name, m.order, m.order_own) == (s, f"radau{2 * s - 1}", 2 * s - 1, s)
    assert method("radau5") is METHODS["radau5"]
    for name in ("radau0", "radau4", "radau31", "radau05", "radau-1", "radau5.0", "radau"):
        with pytest.raises(errors.UnknownNameError, match="radau5"):
            method(name)
    with pytest.raises(ValueError, match="1 to 15 stages"):
        replace(RadauIIA(1), stages=0)
    assert METHODS["radau3"].smallest_pivot == pytest.approx(1 / 7)
    assert METHODS["radau1"].title == "implicit Euler"
