"""Observed orders of every method against its claims, by the rules of the order study."""

import json
import os
import signal

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae.backend import load as load_core
from mbdae.methods import Tableau
from mbdae.methods.variational import NewtonMethod
from mbdae.studies.order import gradients, measurement
from mbdae.studies.order.measurement import LARGEST_RUN, MIN_OUTPUTS, Measurement
from mbdae.studies.order.rates import asymptotic, count_above_floors, fit, is_complete
from mbdae.textbook.problems import TEXTBOOK, hessenberg_a

REGULAR_ON_A = ("herk1", "herk2", "herk3", "pherk3", "kutta3", "rk4", "rule38", "radau1", "radau3")


REFERENCE, MEASUREMENTS = Measurement.reference, {}


def shared_reference(self, name):
    """The reference of a model is computed once, by the core if available."""
    known = self.problem.title, self.T
    if known not in MEASUREMENTS:
        backend = "native" if load_core() else "python"
        MEASUREMENTS[known] = Measurement(self.problem, self.T, self.steps, self.start, self.progress, backend)
        MEASUREMENTS[known].max_solves = LARGEST_RUN
    return REFERENCE(MEASUREMENTS[known], name)


IN_PYTHON = {"heavy_top": 600, "four_bar": 1500, "pendulum": 600}  # solves of a run with which orders are judged
LONGER = {("four_bar", "herk5"): 3000, ("four_bar", "pherk6"): 3000}
SHORT = {"heavy_top": {"T": 0.5, "steps": 5}, "pendulum": {"T": 0.5, "steps": 5}}  # parts of their spans


@pytest.mark.slow
@pytest.mark.parametrize("half", [0, 1])
@pytest.mark.parametrize("model", ["heavy_top", "four_bar", "pendulum"])
def test_orders(model, half, back_end, monkeypatch):
    monkeypatch.setattr(Measurement, "reference", shared_reference)
    mech = mbdae.load(model)
    native = back_end == "native"
    fast = [  # the orders of RATTLE and generalized alpha: test_variational, test_alpha
        n
        for n, m in mbdae.METHODS.items()
        if isinstance(m, Tableau) or (native and m.in_core and not isinstance(m, NewtonMethod))
    ]
    span = {} if native else SHORT.get(model, {})
    for method in fast[half::2]:
        max_solves = LARGEST_RUN if native else LONGER.get((model, method), IN_PYTHON[model])
        monkeypatch.setattr(Measurement, "max_solves", max_solves)
        study = mbdae.order(mech, [method], **span)
        assert study.holds, str(study)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["bicycle", "rolling_disc"])
def test_orders_of_what_rolls(model):
    study = mbdae.order(mbdae.load(model), ["herk3", "pherk4", "herk5", "pherk5", "pherk6", "radau5"])
    assert study.holds, str(study)


@pytest.mark.parametrize("method", REGULAR_ON_A)
def test_orders_where_f_is_nonlinear_in_z(method, monkeypatch):
    monkeypatch.setattr(Measurement, "max_solves", 4000)
    study = mbdae.order(hessenberg_a(), [method])
    assert study.holds, str(study)
    if method in ("kutta3", "rk4", "rule38"):
        assert study.orders[method][0].observed < 2.3


SPANS = {"car_axis_equations": 0.1, "circle": 3.0, "fekete": 0.25, "hessenberg_a": 0.5}
SPANS |= {"controlled_reactor": 1.5, "driven_circuit": 1.5, "mixed_index": 0.5, "stokes": 0.25}


def test_every_textbook_problem_has_a_span():
    assert set(SPANS) == set(TEXTBOOK)


@pytest.mark.slow
@pytest.mark.parametrize("name", SPANS)
def test_no_claim_of_any_method_is_refuted_on_a_textbook_problem(name, monkeypatch):
    """Few steps, many of them too long, and a reference with some more: inconclusive results must be reported so."""
    monkeypatch.setattr(Measurement, "max_solves", 400)
    monkeypatch.setattr(Measurement, "reference", shared_reference)
    problem, T = TEXTBOOK[name](), SPANS[name]
    measure = MEASUREMENTS[problem.title, T] = Measurement(problem, T, 5, None, lambda name: None, "python")
    measure.max_solves = 3000
    runs = []
    study = mbdae.order(problem, T=T, steps=5, progress=runs.append)
    assert len(set(runs)) == len(runs), "no run is made twice"
    assert list(study.orders) == [n for n, m in mbdae.METHODS.items() if "textbook" not in m.excludes]
    assert not study.refuted, str(study)
    assert sum(row[0].verdict == "holds" for row in study.orders.values()) >= 18, str(study)


@pytest.mark.parametrize("method", ["kutta3", "rk4", "rule38"])
def test_order_reduction_is_less_on_mechanisms(method):
    q, v, own, _ = mbdae.order(mbdae.load("four_bar"), [method]).orders[method]
    assert 2.8 <= q.observed < 3.3
    assert 2.8 <= v.observed < 3.3
    assert own.observed < 1.3


def test_what_cannot_be_judged_is_said_so():
    mech = mbdae.load("pendulum")
    study = mbdae.order(mech, ["pherk6"], T=1e-3, steps=MIN_OUTPUTS)
    assert not study.holds
    assert not study.refuted
    assert "cannot be judged" in str(study)
    code, out, _ = call(*["order", "pendulum", "-m", "pherk6", "-t", "1e-3", "--steps", "10", "--json"])
    assert code == 3
    assert json.loads(out)["holds"] is False


def test_coarser_steps_are_tried_if_finer_ones_are_inconclusive():
    """From 160 steps on too few errors of pherk6 are above rounding: the study goes down to five, and no further."""
    mech = mbdae.load("pendulum")
    fixed = mbdae.order(mech, ["pherk6"], steps=160).orders["pherk6"]
    assert not all(s.is_conclusive for s in fixed)
    assert fixed[0].steps[0] == 160, "what the user says stands"
    measure = Measurement(mech, 2.0, 160, mech.assemble(mech.order.q, mech.order.v), lambda name: None, "auto")
    measure.add_coarser_steps = True
    slopes = measure.judge(mbdae.METHODS["pherk6"])
    assert [s.verdict for s in slopes] == ["holds"] * 4
    assert {s.steps for s in slopes} == {slopes[0].steps}
    assert slopes[0].steps[0] in (5, 10, 20, 40, 80)
    direct = mbdae.order(mech, ["pherk6"], T=2.0, steps=slopes[0].steps[0]).orders["pherk6"]
    for found, known in zip(slopes, direct, strict=True):
        n = min(len(found.errors), len(known.errors), 4)
        np.testing.assert_allclose(found.errors[:n], known.errors[:n], rtol=1e-3)
    measure = Measurement(mech, 1e-3, 40, mech.assemble(mech.order.q, mech.order.v), lambda name: None, "auto")
    measure.add_coarser_steps = True
    assert measure.judge(mbdae.METHODS["pherk6"])[0].steps[0] == 5


@pytest.mark.parametrize(
    ("rates", "claimed", "verdict", "observed"),
    [
        ((2, 2, 2, 2), 5, "misses", 2.0),
        ((5, 5, 5, 5), 5, "holds", 5.0),
        ((2.5, 2.3, 2.15, 2.07), 5, "misses", 2.249),
        ((1.08, 1.70, 1.87, 2.08), 2, "holds", 1.975),  # of herk4's z on Hessenberg problem (a)
        ((3.4, 3.4, 1.5, 0.5), 2, "cannot", None),
        ((1, 2, 1.5, 3), 5, "cannot", None),
        ((1.72, 1.08, 1.70, 1.75), 2, "cannot", None),
        ((0.5, 0.5, 3, 2.5), 2, "cannot", None),
        ((60, 20, 6, 5), 5, "holds", 5.5),
        ((6.6, 5.6, 4.0, 4.7), 5, "holds", 5.14),
        ((20, 60, 6, 3), 5, "cannot", None),
    ],
)
def test_a_fit_over_rates_that_change_neither_refutes_nor_proves(rates, claimed, verdict, observed):
    errors = 2.0 ** -np.cumsum([0, *rates])
    found = fit("q", claimed, [10 * 2**i for i in range(5)], errors.tolist(), [0.0] * 5, 0.0, 0.0, LARGEST_RUN)
    assert found.verdict.startswith(verdict)
    assert found.observed == (observed and pytest.approx(observed))
    assert verdict != "cannot" or ", ".join(f"{rate:.2f}" for rate in rates) in found.verdict


def test_multipliers_of_herk4_on_a_textbook_problem_are_not_refuted():
    """z of the method on problem (a), from 1280 to 20480 steps, where the fit of all four halvings is 1.54."""
    errors = [1.91e-6, 5.80e-7, 2.74e-7, 8.43e-8, 2.40e-8]
    ns = [640 * 2**i for i in range(5)]
    assert np.polyfit(np.log2(ns), -np.log2(errors), 1)[0] < 1.8
    found = fit("own z", 2, ns, errors, [0.0] * 5, 0.0, 6.4, LARGEST_RUN)
    assert found.verdict == "cannot be judged: rates still change, 1.72, 1.08, 1.70, 1.81"
    found = fit("own z", 2, [*ns[1:], 20480], [*errors[1:], 6.39e-9], [0.0] * 5, 0.0, 6.4, LARGEST_RUN)
    assert (found.verdict, found.observed) == ("holds", pytest.approx(1.86, abs=0.01)), "they rise to the claim"


def test_errors_as_large_as_the_motion_are_inconclusive():
    """Implicit Euler on the car axis with 10 to 160 steps: each of them damps the whole oscillation away."""
    errors, ns = [0.100, 0.096, 0.089, 0.083, 0.077], [10 * 2**i for i in range(5)]
    assert fit("y", 1, ns, errors, [0.0] * 5, 0.0, 0.0, LARGEST_RUN).verdict == "misses"
    found = fit("y", 1, ns, errors, [0.0] * 5, 0.0, 0.2, LARGEST_RUN)
    assert found.verdict == "cannot be judged: errors are up to 1.0e-01, where it changes by 2.0e-01"


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("high", [-1e-3, -1e-6, 1e-6, 1e-3])
def test_an_error_of_two_orders_is_judged_by_the_lower_one_or_not_at_all(p, high):
    """Error = |h^p high + h^(p+2)|: long steps hide the first term, and the error passes 0 where the signs differ."""
    for claimed in (p, p + 1, p + 2):
        for first in range(12):
            ns = [10 * 2**i for i in range(first, first + 5)]
            errors = [abs(high * n**-p + n ** -(p + 2)) for n in ns]
            verdict = fit("q", claimed, ns, errors, [0.0] * 5, 0.0, 0.0, LARGEST_RUN).verdict
            assert claimed > p or verdict != "misses", (ns, errors)
            assert claimed == p or first < 9 or verdict == "misses", (ns, errors)


def test_rules():
    assert count_above_floors([1.0, 0.1, 1e-9, 1.0], [1e-3] * 4) == 2  # not the one that rose from the floor
    errors = 2.0 ** -np.arange(0, 10, 2)
    ns = [10 * 2**i for i in range(10)]
    assert is_complete(ns, errors, np.zeros(5))
    assert not is_complete(ns, errors[:4], np.zeros(4))
    assert is_complete(ns, [1.0, 1e-9], [1e-3, 1e-3])
    mixed = np.array([10, 20, 30, 40, 60])
    assert is_complete(mixed, mixed**-8.0, np.zeros(5)), "rates of unequal refinements agree"
    noisy = [*3.0 ** -np.arange(6), 3.0**-5, 3.0**-5.5]
    assert asymptotic(ns, noisy) == 6, "what is added up of rounding"
    assert asymptotic(ns, 3.0 ** -np.arange(8)) == 8
    assert asymptotic(ns, noisy[3:]) == 5, "no rates agree"
    found = fit("q", 1, [10 * 2**i for i in range(8)], noisy, [1e-30] * 8, 0.0, 0.0, LARGEST_RUN)
    assert found.observed == pytest.approx(np.log2(3))
    assert found.fitted == (1, 6)
    reduced = 2.0 ** -np.cumsum([0, 5, 5, 5, 5, 4.5, 4, 4, 4, 4])
    found = fit("q", 5, [10 * 2**i for i in range(10)], reduced.tolist(), [1e-30] * 10, 0.0, 0.0, LARGEST_RUN)
    assert (found.verdict, found.observed) == ("misses", pytest.approx(4)), "where finer steps agree they count"


@pytest.mark.parametrize("claimed", [2, 5])
def test_an_order_holds_down_to_a_fifth_below_its_claim(claimed):
    steps = [10, 20, 40, 80, 160, 320]
    for less, verdict in ((-0.5, "holds"), (0.0, "holds"), (0.15, "holds"), (0.25, "misses"), (0.9, "misses")):
        errors = [n ** -(claimed - less) for n in steps]
        found = fit("q", claimed, steps, errors, [1e-30] * len(steps), 0.0, 0.0, LARGEST_RUN)
        assert found.observed == pytest.approx(claimed - less)
        assert (found.verdict, found.fitted) == (verdict, (1, 6))


@pytest.mark.parametrize(
    ("errors", "uncertainty", "why"),
    [
        ([], 0.0, "no run was completed"),
        ([1e-9] * 6, 1e-10, "no error above 100 times the uncertainty of the reference, 1.0e-10"),
        ([1e-15] * 6, 1e-17, "no error above 100 times rounding"),
        ([1e-3, 1e-4, 1e-9], 1e-10, "only 1 refinement above 100 times the uncertainty of the reference, 1.0e-10"),
        ([1e-3, 1e-4, 1e-5], 0.0, "only 2 refinements within 120000 solves"),
    ],
)
def test_the_reason_why_an_order_cannot_be_judged(errors, uncertainty, why):
    """Rounding is 1e-15."""
    ns, floors = [10 * 2**i for i in range(len(errors))], [100 * (uncertainty + 1e-15)] * len(errors)
    assert fit("q", 5, ns, errors, floors, uncertainty, 0.0, LARGEST_RUN).verdict == f"cannot be judged: {why}"


def test_runs_at_rest_are_not_refined():
    """Joints that stick: one pair of coarse runs of each reference shows that steps leave nothing but rounding."""
    runs = []
    study = mbdae.order(mbdae.load("stick_slip_slider"), "herk2", T=0.001, steps=10, progress=runs.append)
    assert runs[:4] == ["pherk6, 10 steps", "pherk6, 20 steps", "herk5, 10 steps", "herk5, 20 steps"]
    assert all(run.startswith("herk2") for run in runs[4:])
    q, v, own, lam = study.orders["herk2"]
    assert {x.verdict for x in (q, v, lam)} == {"cannot be judged: no error above 100 times rounding"}
    assert own.verdict == "holds", "own multipliers carry other errors"


def test_a_method_whose_runs_fail_says_why():
    found = fit("q", 5, [], [], [], 0.0, 0.0, LARGEST_RUN, "the step became too small")
    assert found.verdict == "cannot be judged: no run was completed, the step became too small"


@pytest.mark.slow
def test_the_gain_of_multipliers_is_found_once(monkeypatch):
    problem = hessenberg_a()
    system = type(problem.system())
    find, found = system.multiplier_gain, []
    monkeypatch.setattr(system, "multiplier_gain", lambda *given: found.append(given) or find(*given))
    mbdae.order(problem, ["herk1", "herk2"], T=0.5)
    assert len(found) == 1


@pytest.mark.parametrize("study", ["order", "check-gradients"])
def test_ctrl_c_keeps_the_methods_that_are_finished(study, tmp_path, monkeypatch):
    where = measurement if study == "order" else gradients
    real = where.solve

    def solve(*args, method, **options):
        press = (lambda done: os.kill(os.getpid(), signal.SIGINT)) if method.name == "herk3" else None
        return real(*args, method=method, progress=press, **options)

    monkeypatch.setattr(where, "solve", solve)
    arguments = [study, "pendulum", "-m", "herk2,herk3,herk4", "-t", "0.2", "-o", "o.json"]
    code, out, err = call(*arguments, cwd=tmp_path)
    assert code == 1
    assert err == "mbdae: stopped by the user after 1 of 3 methods; herk3, herk4 remain\n"
    assert "stopped: herk3, herk4 remain" in out
    kept = json.loads((tmp_path / "o.json").read_text())
    assert (list(kept["methods"]), kept["missing"], kept["holds"]) == (["herk2"], ["herk3", "herk4"], False)
    code, out, err = call(*arguments[:2], "-m", "herk3")
    assert (code, out, err.strip()) == (130, "", "mbdae: stopped by the user")


def test_all_methods_are_named_by_all(monkeypatch):
    monkeypatch.setattr("mbdae.studies.order.order.run_until_interrupted", lambda chosen, judge: ({}, tuple(chosen)))
    assert mbdae.order("pendulum", "all").missing == mbdae.order("pendulum").missing
    assert "herk3" in mbdae.order("pendulum", ["all"]).missing
