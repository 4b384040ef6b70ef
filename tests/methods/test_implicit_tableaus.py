"""Implicit tableaus: the table of index-2 theory on a known solution, exact proofs, mechanisms, rejections."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from commands import call
from shared import shared_model

import mbdae
from mbdae.errors import InputError
from mbdae.methods import METHODS
from mbdae.methods.implicit_tableau import ImplicitTableau
from mbdae.methods.order.assumptions import assumptions
from mbdae.methods.order.conditions import check_conditions
from mbdae.studies.order.measurement import Measurement
from mbdae.system import Counts, State, System
from mbdae.textbook.problems import hessenberg_a

NAMES = [name for name, m in METHODS.items() if isinstance(m, ImplicitTableau)]
every = pytest.mark.parametrize("name", NAMES)

# Orders of y and z: Hairer, Wanner II, table VII.4.1. R(infinity), B, C, D: section IV.5. Errors with 160 steps: those
# of another program, of y and, where it does not converge, of z.
TABLE = {
    "midpoint": (2, 0, -1, "B(2) C(1) D(1)", 8.0e-5, 0.37),
    "gauss2": (2, 0, 1, "B(4) C(2) D(2)", 2.6e-6, 0.61),
    "gauss3": (4, 2, -1, "B(6) C(3) D(3)", None, None),
    "radau_ia2": (2, 1, 0, "B(3) C(1) D(2)", 3.4e-3, None),
    "radau3": (3, 2, 0, "B(3) C(2) D(1)", 3.2e-7, None),
    "lobatto_iiic2": (2, 1, 0, "B(2) C(1) D(1)", 2.8e-3, None),
    "lobatto_iiic3": (4, 2, 0, "B(4) C(2) D(2)", 8.9e-10, None),
    "sdirk2": (2, 1, 0, "B(2) C(1) D(0)", 9.5e-4, None),
}


def test_the_table_has_every_method():
    assert set(TABLE) == {*NAMES, "radau3"}


@cache
def end_errors(name, n):
    """Errors of y and of the method's z at t = 1 on problem (a)."""
    problem = hessenberg_a()
    sol = mbdae.solve(problem, (0, 1), method=name, step=1 / n)
    assert sol.ended, sol.message
    y, z = problem.exact(1.0)
    return np.array([np.abs(sol.y[-1] - y).max(), np.abs(sol.z_own[-1] - z).max()])


@pytest.mark.parametrize("name", TABLE)
def test_the_table_of_implicit_methods_on_problem_a(name):
    order, own, _, _, error_y, error_z = TABLE[name]
    coarse, fine = end_errors(name, 80), end_errors(name, 160)
    slopes = np.log2(coarse / fine)
    np.testing.assert_allclose(slopes, [order, own], atol=0.25)
    for found, known in zip(fine, (error_y, error_z), strict=True):
        assert known is None or found == pytest.approx(known, rel=0.02)  # of two digits


@pytest.mark.parametrize("name", TABLE)
def test_claims_are_proven_exactly_and_nothing_more_holds(name):
    order, own, growth, held, _, _ = TABLE[name]
    m = METHODS[name]
    found = check_conditions(m)
    assert (m.order, m.order_own) == (found.order_y, found.order_own) == (order, own)
    assert found.order_y_linear == m.order_linear == order
    assert found.holds
    assert m.R_infinity == growth
    assert assumptions(m).implicit == held
    assert not check_conditions(m, max_order=order + 1).order_y > order
    for claim in ("order", "order_own") if name in NAMES else ():
        assert not check_conditions(replace(m, **{claim: getattr(m, claim) + 1})).holds


@every
def test_a_damaged_coefficient_is_found(name):
    m = METHODS[name]
    first, *others = m.b
    assert not check_conditions(replace(m, b=(f"{first}+1/1000000", *others))).holds
    damaged = ((*m.A[0][:-1], f"{m.A[0][-1]}+1/1000000"), *m.A[1:])
    found = check_conditions(replace(m, A=damaged))
    assert not found.holds or name == "midpoint"  # |R(infinity)| < 1 is a little better, and the order is 1
    assert name != "midpoint" or check_conditions(replace(m, A=(("1/2+1/1000000",),))).order_y == 1


class Probe(System):
    """y' = e_i at the i-th stage, whatever is solved: shows the coefficients of a step."""

    def __init__(self, n):
        self.ny, self.nz, self.counts, self.error_components = n, n, Counts(), slice(None)
        self.unknowns, self.points = (), []

    def chart(self, t, y):
        return self

    def start(self):
        return np.zeros(self.ny), np.full(self.nz, 5.0)

    def component_magnitudes(self, y):
        return np.ones(self.ny)

    def residual(self, t, x, dx, z):
        self.points.append((t, x))
        i = (len(self.points) - 1) % self.ny
        return np.eye(self.ny)[i] - dx, np.eye(self.ny)[i] - z

    def linearize(self, x, dx, z):
        return self

    def factorize(self, mu):
        return lambda r, c: (r, c)

    def end(self, t, x, dx, z):
        return x, z

    def rounding_loss(self, y0, x, y1):
        return None


@every
def test_the_step_recovers_its_tableau(name):
    m, t, h = METHODS[name], 0.7, 0.25
    s = m.stages
    probe = Probe(s)
    step = m.step(probe, t, h, State(np.zeros(s)))
    A, b = (np.array(x, float) for x in (m.exact_A, m.exact_b))
    times, points = zip(*probe.points[-s:], strict=True)
    np.testing.assert_allclose(np.array(points) / h, A[1:, 1:], atol=1e-9)
    np.testing.assert_allclose((np.array(times) - t) / h, A[1:].sum(1), atol=1e-14)
    np.testing.assert_allclose(step.state.y / h, b[1:], atol=1e-9)
    weights = b[1:] @ np.linalg.inv(A[1:, 1:])
    np.testing.assert_allclose(step.z, weights + (1 - weights.sum()) * 5.0, atol=1e-9)


T = 0.22  # s


@cache
def reference(model):
    """q, v and lam at five times."""
    best = mbdae.solve(shared_model(model), (0, T), method="pherk6", step=T / 400)
    return tuple(x[::100] for x in (best.q, best.v, best.lam))


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("formulation", ["index2", "ggl"])
@pytest.mark.parametrize("model", ["four_bar", "bricard"])
@every
def test_orders_on_mechanisms(name, model, formulation):
    """Bricard's mechanism has a redundant row; positions may be more accurate than claimed."""
    mech, m, (q, v, lam) = shared_model(model), METHODS[name], reference(model)
    errors = []
    steps = 32 if name == "sdirk2" else 8  # its z reaches its order late
    for n in (steps, 2 * steps):
        sol = mbdae.solve(mech, (0, T), method=name, step=T / n, formulation=formulation)
        assert sol.ended, sol.message
        pairs = ((sol.q, q), (sol.v, v), (sol.lam, lam), (sol.lam_own, lam))
        errors.append([np.abs(x[:: n // 4] - y).max() for x, y in pairs])
    q, v, lam, own = np.log2(np.divide(*errors))
    assert min(q, v, lam) > m.order - 0.25
    assert max(v, lam) < m.order + 0.6
    assert own > m.order_own - 0.25


def test_back_ends_agree():
    mech = shared_model("four_bar")
    for name in ("lobatto_iiic3", "sdirk2"):
        ends = [mbdae.solve(mech, (0, 0.4), method=name, step=0.02, backend=b) for b in ("native", "python")]
        assert [sol.stats["backend"] for sol in ends] == ["native", "python"]
        np.testing.assert_allclose(ends[0].y[-1], ends[1].y[-1], rtol=0, atol=1e-11)
    sol = mbdae.solve(mech, (0, 0.1), method="gauss2", step=0.02)
    assert sol.stats["backend"] == "python"
    assert "'gauss2'" in sol.stats["fallback"]


def test_methods_are_listed_with_their_assumptions():
    code, out, _ = call("methods")
    assert code == 0
    line = next(line for line in out.splitlines() if line.startswith("gauss2"))
    assert "B(4) C(2) D(2)" in line
    assert " 1.0 " in line
    code, out, _ = call("methods", "--check", "gauss2", "radau3")
    assert code == 0
    assert "own z does not converge" in out
    assert "R(infinity) = 1" in out


def test_order_says_what_does_not_converge():
    code, out, _ = call("order", "hessenberg_a", "-m", "gauss2", "--steps", "10")
    assert code == 0
    assert "(0: does not converge)" in out


def test_a_claim_that_fails_is_refuted(monkeypatch):
    monkeypatch.setattr(Measurement, "max_solves", 4000)
    bold = replace(METHODS["gauss2"], name="bold", order_own=1)
    study = mbdae.order(hessenberg_a(), [bold])
    assert study.refuted
    assert study.orders["bold"][1].verdict == "misses"


def test_rejections():
    trapezium = {"name": "trapezium", "title": "", "reference": "", "A": (("0", "0"), ("1/2", "1/2"))}
    with pytest.raises(InputError, match="'trapezium': A is singular: its inverse determines z"):
        ImplicitTableau(**trapezium, b=("1/2", "1/2"), order=2, order_own=0)
    with pytest.raises(InputError, match="A has 1 rows of 1 numbers, as many as b"):
        ImplicitTableau(**trapezium, b=("1",), order=2, order_own=0)
    for A, b, message in [
        ((("x",),), ("1",), "not an exact number: 'x'"),
        ((("1 2",),), ("1",), "not an exact number: '1 2'"),
        ((("1/0",),), ("1",), "not an exact number: '1/0'"),
        ((("1",),), ("one",), "not an exact number: 'one'"),
        ((("sqrt(2)",),), ("sqrt(3)",), r"cannot mix sqrt\(3\) and sqrt\(2\)"),
        ((), (), "A has 0 rows of 0 numbers, as many as b, at least one"),
    ]:
        with pytest.raises(InputError, match=f"tableau 'trapezium': {message}"):
            ImplicitTableau(**{**trapezium, "A": A}, b=b, order=2, order_own=0)
    code, _, err = call("solve", "four_bar", "-m", "gauss2")
    assert code != 0
    assert err == "mbdae: method 'gauss2' takes fixed steps: give a step\n"
    sol = mbdae.solve(shared_model("four_bar"), (0, 0.1), method="sdirk2", step=0.01)
    with pytest.raises(InputError, match="derivatives of runs are those of half-explicit methods and Radau IIA"):
        mbdae.sensitivity(sol, start=True)
