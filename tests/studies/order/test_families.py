"""Claims of RATTLE and generalized alpha by the order study itself: (q, v, lam) on six mechanisms, exit code 0."""

import json

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae.methods import METHODS
from mbdae.studies.order.measurement import LARGEST_RUN, Measurement

METHODS_OF_FAMILIES = ("rattle2", "rattle4", "rattle6", "rattle8", "alpha", "alpha_i3", "hht")
MODELS = ("pendulum", "four_bar", "bricard", "stewart_platform", "heavy_top", "dual_arm")
SOLVES = {"stewart_platform": 30_000, "heavy_top": 30_000, "dual_arm": 15_000}  # of a run, which suffice


@pytest.mark.slow
@pytest.mark.native
@pytest.mark.parametrize("model", MODELS)
def test_orders_hold_on_the_command_line(model, monkeypatch):
    monkeypatch.setattr(Measurement, "max_solves", SOLVES.get(model, LARGEST_RUN))
    code, out, err = call("order", model, "-m", ",".join(METHODS_OF_FAMILIES), "--json")
    assert code == 0, out + err
    found = json.loads(out)["methods"]
    assert tuple(found) == METHODS_OF_FAMILIES
    for name, row in found.items():
        q, v, own, lam = row
        assert min(x["observed"] for x in (q, v, lam)) > METHODS[name].order - 0.2, name
        assert own["observed"] > METHODS[name].order_own - 0.2, name


@pytest.mark.native
@pytest.mark.parametrize("name", ["rattle4", "alpha"])
def test_a_claim_of_one_order_more_is_refuted(name, monkeypatch):
    monkeypatch.setattr(type(METHODS[name]), "order_linear", METHODS[name].order + 1)
    study = mbdae.order("heavy_top", [name])
    assert study.refuted, str(study)


def test_steps_between_halvings_share_the_common_times():
    """Strides are even: own multipliers of methods with R(inf) = -1 alternate."""
    measure = Measurement(mbdae.load("pendulum"), 2.0, 10, None, lambda name: None, "auto")
    assert measure.intermediate_steps([5, 10, 20, 40], 2, 5) == [30, 60]
    assert measure.intermediate_steps([5, 10, 20, 30, 40, 60], 4, 5) == [50, 70, 90]


@pytest.mark.native
def test_rounding_of_multipliers_of_index_3_grows_with_the_square_of_the_steps():
    """The own multipliers of alpha_i3 stop to converge at h = 1e-4 s; those of the stabilized form do not."""
    mech = mbdae.load("pendulum")
    measure = Measurement(mech, 2.0, 10, mech.assemble(mech.order.q, mech.order.v), lambda name: None, "native")
    size, h = np.array([1.0, 4.0, 40.0, 40.0]), 2 / 20480
    index3, index2 = (measure.rounding(METHODS[x], h, size)[-2] for x in ("alpha_i3", "alpha"))
    assert measure.rounding(METHODS["alpha_i3"], h / 2, size)[-2] == pytest.approx(4 * index3, rel=0.01)
    own = measure.judge(METHODS["alpha_i3"])[2]
    assert own.observed == pytest.approx(2, abs=0.05)
    assert own.errors[-1] > 10 * index3 > 100 * index2
    assert own.errors[own.fitted[1] - 1] > own.floors[own.fitted[1] - 1]
