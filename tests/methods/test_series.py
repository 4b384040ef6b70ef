"""One step of every method as an exact power series in h: its order without any tree.

    r' = u + r w,   u' = r + u w + e z^2 + r z,   w' = u + z,   0 = w - r^2        (e = 1, or 0: linear in z)

The constrained point needs r alone and r' does not contain z, so that z_i follows explicitly; r' contains u and w, so
that the errors of all stages enter the constraint.
"""

from fractions import Fraction

import pytest

from mbdae.methods import METHODS
from mbdae.methods.exact_numbers import exact
from mbdae.methods.tableau import Tableau

TABLEAUS = {name: m for name, m in METHODS.items() if isinstance(m, Tableau)}
START = (Fraction(1, 2), Fraction(1, 3), Fraction(1, 4))  # r, u, w = r^2


class Series:
    """A power series in h truncated after a fixed number of terms."""

    def __init__(self, terms):
        self.terms = list(terms)

    def __add__(self, other):
        return Series(x + y for x, y in zip(self.terms, other.terms, strict=True))

    def __sub__(self, other):
        return self + other.scaled(-1)

    def __mul__(self, other):
        n = len(self.terms)
        x, y = self.terms, other.terms
        return Series(sum((x[j] * y[k - j] for j in range(k + 1) if x[j]), Fraction(0)) for k in range(n))

    def scaled(self, factor):
        return Series(x * factor for x in self.terms)

    def times_h(self):
        return Series([Fraction(0), *self.terms[:-1]])

    def over_h(self):
        """Divide by h; the last term is then unknown and never enters a result that is compared."""
        assert abs(float(self.terms[0])) < 1e-25
        return Series([*self.terms[1:], Fraction(0)])


def rates(r, u, w, z, e):
    return u + r * w, r + u * w + (z * z).scaled(e) + r * z, u + z


def hidden(r, u, w):
    """z from the hidden constraint w' = 2 r r'."""
    return (r * (u + r * w)).scaled(2) - u


def exact_solution(e, n):
    """Taylor series of r, u, w, z at t = h by n Picard iterations."""
    y = [Series([x] + [Fraction(0)] * (n - 1)) for x in START]
    for _ in range(n):
        derivatives = rates(*y, hidden(*y), e)
        y = [
            Series([x, *(s.terms[k] / (k + 1) for k in range(n - 1))])
            for x, s in zip(START, derivatives, strict=True)
        ]
    return [*y, hidden(*y)]


def one_step(tableau, e, n, weights=None):
    """r, u, w after a step with given weights (b), and z of the last stage."""
    y0 = [Series([x] + [Fraction(0)] * (n - 1)) for x in START]
    A, Ahat = tableau.exact_A, tableau.exact_Ahat
    derivatives = []

    def advance(row):
        y = list(y0)
        for a, derivative in zip(row, derivatives, strict=False):
            if a:
                y = [x + s.scaled(a).times_h() for x, s in zip(y, derivative, strict=True)]
        return y

    for i in range(len(A)):
        stage = advance(A[i])
        if i == 0 and tableau.explicit_first:
            z = hidden(*y0)
        else:
            known, pivot = advance(Ahat[i][:i]), Ahat[i][i]
            r, u, w = stage
            rhat = known[0] + (u + r * w).scaled(pivot).times_h()
            z = (rhat * rhat - known[2]).over_h().scaled(1 / pivot) - u
        derivatives.append(rates(*stage, z, e))
    return [*advance(weights or tableau.exact_b), z]


def projected(y_hat, y_1, z_1, e):
    """Move along f_z(y_1, z_1) = (0, 2 e z_1 + r_1, 1) onto 0 = w - r^2."""
    r, u, w = y_hat
    mu = r * r - w
    return r, u + (z_1.scaled(2 * e) + y_1[0]) * mu, w + mu


def agreement(x, y):
    """Number of leading terms that agree."""
    differ = (k for k, (p, q) in enumerate(zip(x.terms, y.terms, strict=True)) if abs(float(p - q)) > 1e-20)
    return next(differ)


@pytest.mark.parametrize("name", TABLEAUS)
@pytest.mark.parametrize("e", [0, 1])
def test_local_error(name, e):
    tableau = TABLEAUS[name]
    order = tableau.order if e else tableau.order_linear
    n = order + 3
    *y, z = one_step(tableau, e, n)
    *true, true_z = exact_solution(e, n)
    assert min(agreement(a, b) for a, b in zip(y, true, strict=True)) == order + 1
    assert agreement(z, true_z) == tableau.order_own
    gap = y[2] - y[0] * y[0]  # the constraint holds at the end of the step
    assert max(abs(float(x)) for x in gap.terms) < 1e-20


@pytest.mark.parametrize("name", [name for name, tableau in TABLEAUS.items() if tableau.b_embedded])
@pytest.mark.parametrize("e", [0, 1])
def test_embedded_formula(name, e):
    tableau = TABLEAUS[name]
    n = tableau.order + 2
    *y_1, z_1 = one_step(tableau, e, n)
    *true, _ = exact_solution(e, n)
    for lower, weights in enumerate((tableau.b_embedded, tableau.b_companion)):
        if weights:
            *y, _ = one_step(tableau, e, n, [exact(x) for x in weights])
            raw = min(agreement(a, b) for a, b in zip(y, true, strict=True))
            y = projected(y, y_1, z_1, e)
            assert (
                min(agreement(a, b) for a, b in zip(y, true, strict=True))
                == tableau.order_embedded + 1 - lower
            )
            assert (raw < tableau.order_embedded + 1 - lower) is tableau.project_embedded
