"""Invalid input of a search: one line that names it, with the user's exception as its cause."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, MbdaeError, UnknownNameError

G = {"gravity.2": -9.0}
LENGTH = {"frame.coupler_tip.xyz.0": 2.5}
CURVE = {"drive": "crank", "span": (1.2, 2.2), "points": 5}
RUN = {"t_span": (0.0, 0.1), "step": 0.05}


def height(signals):
    return float(signals["q.rocker"][-1]), {"q.rocker": np.eye(1, len(signals["t"]), len(signals["t"]) - 1)[0]}


def weight(signals):
    return signals["gravity.2"] ** 2, {"gravity.2": 2 * signals["gravity.2"]}


def search(cost=height, parameters=None, **options):
    return mbdae.optimize("four_bar", cost, parameters or G, **({} if "drive" in options else RUN), **options)


def reported(answer):
    """A function of signals with a result that does not depend on them."""

    def own(signals):
        return answer

    return own


def broken(signals):
    return 1 / 0


def silent():
    return 0.0, {}


ANSWERS = [
    ((np.nan, {}), "is nan"),
    ((1j, {}), "returns .value"),
    ((np.complex128(1), {}), "returns .value"),
    ((1.0, {"q.rocker": 1j * np.ones(3)}), "returns .value"),
    ((True, {}), "returns .value"),
    ((None, {}), "returns .value"),
    (("1.5", {}), "returns .value"),
    ((1.0, {}, {}), "returns .value"),
    ((1.0, [1.0]), "returns .value"),
    ((1.0, {"q.rocker": np.ones(2)}), ": its derivative with respect to 'q.rocker' must be 3 finite numbers"),
    ((1.0, {"gravity.2": np.ones(2)}), ": its derivative with respect to 'gravity.2' is a number, got array"),
    ([1.0, {"gravity.2": "a"}], ": its derivative with respect to 'gravity.2' is a number, got 'a'"),
    ((1.0, {"gravity.2": np.nan}), ": its derivative with respect to 'gravity.2' is a number, got nan"),
]


@pytest.mark.parametrize(("answer", "words"), ANSWERS)
def test_a_wrong_answer_is_that_of_a_cost_or_of_a_constraint(answer, words):
    with pytest.raises(InputError, match=f"^cost 'own' ?{words}"):
        search(reported(answer))
    with pytest.raises(InputError, match=f"^constraint 'reach' ?{words}"):
        search(constraints={"reach": (reported(answer), 0, 1)})


@pytest.mark.parametrize(("function", "cause"), [(broken, ZeroDivisionError), (silent, TypeError)])
def test_a_function_that_fails_is_named_with_the_parameters_and_its_exception(function, cause):
    for where in (RUN, CURVE):
        with pytest.raises(InputError, match=rf"^cost '{function.__name__}' failed at gravity\.2 = -9: ") as found:
            mbdae.optimize("four_bar", function, G, **where)
        assert isinstance(found.value.__cause__, cause)
    with pytest.raises(InputError, match=rf"^constraint 'reach' failed at gravity\.2 = -9: {cause.__name__}"):
        search(constraints={"reach": (function, 0, 1)})


def late(error, after=3):
    """A cost that fails from some call on."""
    calls = []

    def cost(signals):
        calls.append(1)
        if len(calls) >= after:
            raise error
        return weight(signals)

    return cost


def test_what_fails_later_is_kept_and_said():
    """As a motion that cannot be computed its cost is infinite; the reason is stored with the point."""
    found = search(late(ZeroDivisionError("later")), iterations=3)
    lost = [t for t in found.history if t.error]
    assert lost
    assert all(np.isnan(t.cost) for t in lost)
    assert found.cost == min(t.cost for t in found.history if not t.error)
    assert "cost 'cost' failed at gravity.2 = " in lost[0].error
    assert f"{len(lost)} of {len(found.history)} points could not be computed, the last: cost 'cost' f" in str(found)
    assert any("ZeroDivisionError: later" in text for text in found.remarks())
    assert found.to_dict()["history"][-1]["error"] == found.history[-1].error
    stopped = search(late(KeyboardInterrupt()))
    assert stopped.interrupted
    assert not stopped.failures


def test_a_search_keeps_its_best_point_when_progress_or_gradients_fail():
    said = []

    def tell(text):
        said.append(text)
        if len(said) == 2:
            raise OSError("no terminal")

    found = search(weight, progress=tell)
    assert not found.converged
    assert found.message == "progress failed: OSError: no terminal"
    assert found.cost <= found.start.cost

    def model(length):
        if length < 2.6 and length != 2.42:  # the search ends there, quotients reach beyond
            raise ValueError("too short")
        return mbdae.load("four_bar")

    def own(signals):
        return signals["length"], {"length": 1.0, "holding": np.zeros(len(signals["u"]))}

    edge = mbdae.optimize(model, own, {"length": 3.0}, {"length": (2.42, 4.0)}, **CURVE)
    assert not edge.converged
    assert edge.cost < edge.start.cost
    assert "'length' = 2.42 cannot be changed by" in edge.message
    assert "ValueError: too short" in edge.message
    assert edge.to_dict()["gradient"] == {"length": None}


OPTIONS = [
    ({"span": (0, 1)}, UnknownNameError, "unknown setting of solve 'span'; valid: .*step"),
    ({"nonsense": 1}, UnknownNameError, "unknown setting of solve 'nonsense'"),
    ({**CURVE, "step": 0.1}, UnknownNameError, "unknown setting of kinematics 'step'; valid: span, turns"),
    ({**CURVE, "t_span": (0, 1)}, InputError, "a curve over a drive has no t_span"),
    ({**CURVE, "span": 3}, InputError, "span is two different numbers, from and to, got 3"),
    ({**CURVE, "span": (None, 1)}, InputError, "span is two different numbers"),
    ({**CURVE, "span": "ab"}, InputError, "span is two different numbers"),
    ({"drive": "crank", "turns": "a"}, InputError, "turns must be a positive number, got 'a'"),
    ({"tolerance": "a"}, InputError, "iterations and tolerance are positive, got 200 and 'a'"),
    ({"tolerance": np.inf}, InputError, "iterations and tolerance are positive"),
    ({"iterations": True}, InputError, "iterations and tolerance are positive, got True"),
    ({"progress": 3}, InputError, "progress is a function of a text, got 3"),
    ({"constraints": {"": (height, 0, 1)}}, InputError, "constraints have names"),
    ({"constraints": {3: (height, 0, 1)}}, InputError, "constraints have names, .*got 3"),
    ({"constraints": {"a": (height, None, None)}}, InputError, "constraint 'a' has no limit"),
    ({"constraints": {"a": (height, -np.inf, np.inf)}}, InputError, "constraint 'a' has no limit"),
]


@pytest.mark.parametrize(("options", "error", "words"), OPTIONS)
def test_what_is_no_option(options, error, words):
    with pytest.raises(error, match=words):
        search(**options)


NO_PAIRS = [(np.nan, 1), (2, 1), (1,), "a", "12", 3, (1, 2, 3), (-10, "a"), (False, True), (-10, 1j), (np.inf, np.inf),
            (-np.inf, -np.inf), {-10: 0, 0: 1}, ([-10], [0])]  # fmt: skip


@pytest.mark.parametrize("pair", NO_PAIRS, ids=repr)
def test_what_is_no_range(pair):
    with pytest.raises(InputError, match=r"parameter 'gravity\.2' takes \(low, high\) with low <= high"):
        search(bounds={"gravity.2": pair})
    if isinstance(pair, tuple):
        with pytest.raises(InputError, match=r"constraint 'a' takes \((function, )?low, high\)"):
            search(constraints={"a": (height, *pair)})
    words = "starts at 1, outside" if len(np.shape(pair)) and len(pair) == 3 else r"takes \(low, high\) or \(start, low"
    with pytest.raises(InputError, match=rf"parameter 'gravity\.2' {words}"):
        mbdae.fit("four_bar", {"gravity.2": pair}, {"t": [0.1], "q.crank": [1.2]})


def test_what_is_a_range():
    for pair in ((None, None), [-10.0, None], np.array([-10, -8])):
        low, high = search(bounds={"gravity.2": pair}, iterations=1).bounds["gravity.2"]
        assert low <= -9 <= high
    fixed = search(bounds={"gravity.2": (-9, -9)})
    assert fixed.converged
    assert fixed.values == G


def other(length):
    raise ValueError("no such length")


MODELS = [
    (other, {"length": 1.0}, MbdaeError, r"model 'other' failed at length = 1\.0: ValueError: no such length"),
    (other, {"width": 1.0}, UnknownNameError, "unknown parameter of other 'width'.*valid: length"),
    (dict, {"length": 1.0}, InputError, "model 'dict' has no readable signature"),
]  # fmt: skip


@pytest.mark.parametrize(("model", "parameters", "error", "words"), MODELS)
def test_a_model_that_fails_is_named_with_its_parameters(model, parameters, error, words):
    with pytest.raises(error, match=words) as found:
        mbdae.optimize(model, height, parameters, **RUN)
    assert model is not other or error is UnknownNameError or isinstance(found.value.__cause__, ValueError)
