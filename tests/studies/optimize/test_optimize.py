"""Optimal parameters of a motion: closed forms, gradients against differences, failures, and interrupts."""

import json

import numpy as np
import pytest
from sprung_arm import ARM

import mbdae
from mbdae import finite_differences
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.studies.optimize.objective import curve_function, run_function

STIFFNESS = {"force.spring.stiffness": 10.0}
BALANCE = 2.0 * 9.81 * 0.5 / (0.6 * 0.4)  # k h a = m g r: a spring without rest length balances the arm everywhere


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(ARM)
    return path


def uneven(signals):
    torque = signals["holding"]
    return torque @ torque / 2, {"holding": torque}


@pytest.mark.parametrize("search", ["SLSQP", "L-BFGS-B"])
def test_a_spring_without_rest_length_carries_an_arm(arm, search):
    found = mbdae.optimize(arm, uneven, STIFFNESS, drive="arm", span=(-1.0, 1.0), points=9, search=search)
    assert found.converged, found
    assert found.values["force.spring.stiffness"] == pytest.approx(BALANCE, rel=1e-6)
    assert found.cost < 1e-9 * found.start.cost
    assert found.mechanism.forces[0].stiffness == found.values["force.spring.stiffness"]
    assert found.motion.drive == "arm"


def test_constraints_hold(arm):
    """The spring force is limited to 20 N when the arm is level: k d = 20, below the balance."""
    reach = np.hypot(0.6, 0.4)

    def pull(signals):
        k = signals["force.spring.stiffness"]
        return k * reach, {"force.spring.stiffness": reach}

    found = mbdae.optimize(arm, uneven, STIFFNESS, constraints={"pull": (pull, None, 20.0)}, drive="arm",
                           span=(-1.0, 1.0), points=9)  # fmt: skip
    assert found.converged, found
    assert found.constraints["pull"] == pytest.approx(20.0, rel=1e-5)
    assert found.values["force.spring.stiffness"] == pytest.approx(20.0 / reach, rel=1e-5)


CURVES = [
    ("four_bar", {"span": (1.2, 2.2)}, ["v.rocker", "q.coupler", "holding", "position.coupler_tip.x"],
     {"frame.coupler_tip.xyz.0": 2.5, "joint.rocker.xyz.0": 3.0, "joint.coupler.mass": 1.0}),
    ("jansen_walker?legs=1", {}, ["position.foot_0.z", "holding", "v.shin_0"],
     {"frame.knee_0.xyz.0": 0.367, "body.thigh_0.xyz.0": -0.38}),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("model", "options", "signals", "values"), CURVES)
def test_curves_are_differentiated_at_equal_inputs(model, options, signals, values):
    make = Template(model)
    follow = curve_function(make, "crank", make.make(values), {"points": 5, **options})
    here = follow(values).signals
    for i, (name, x) in enumerate(values.items()):
        h = 2e-3 * abs(x)
        near = {k: follow({**values, name: x + k * h}).signals for k in finite_differences.STENCIL}
        for signal in signals:
            quotient = finite_differences.central_difference({k: found[signal] for k, found in near.items()}, h)
            own = here.derivative(signal)[:, i]
            assert np.abs(own - quotient).max() < 1e-8 * (1 + np.abs(own).max()), (name, signal)


def test_holding_torques_agree_with_inverse_dynamics():
    mech = mbdae.load("four_bar")
    make = Template("four_bar")
    signals = curve_function(make, "crank", mech, {"span": (1.2, 2.2), "points": 5})({"gravity.2": -9.81}).signals
    statics = mbdae.inverse_dynamics(mech, signals.curve, speed=1e-7)
    np.testing.assert_allclose(signals["holding"], statics.efforts[:, 0], rtol=1e-10)


def test_runs_are_differentiated_with_what_the_parameters_cost_themselves():
    def cost(signals):
        end = np.zeros(len(signals["t"]))
        end[-1] = 1.0
        g = signals["gravity.2"]
        return signals["q.rocker"][-1] + g**2, {"q.rocker": end, "gravity.2": 2 * g}

    run = run_function(Template("four_bar"), (0.0, 0.2), {"step": 0.02})
    found = run({"gravity.2": -9.0}).evaluate(cost)
    near = {k: run({"gravity.2": -9.0 + 0.01 * k}).evaluate(cost).value for k in (-2, -1, 1, 2)}
    quotient = (near[-2] - 8 * near[-1] + 8 * near[1] - near[2]) / 0.12
    assert found.derivatives()[0] == pytest.approx(quotient, rel=1e-9)


def test_where_loops_do_not_close_the_cost_is_infinite():
    """A decreasing coupler length cannot reach the rocker: the search turns back there."""
    coupler = "frame.coupler_tip.xyz.0"

    def length(signals):
        return signals[coupler], {coupler: 1.0}

    options = {"drive": "crank", "span": (1.2, 2.2), "points": 5}
    found = mbdae.optimize("four_bar", length, {coupler: 2.5}, scales={coupler: 2.0}, iterations=3, **options)
    assert any(np.isnan(t.cost) for t in found.history)
    assert found.cost == min(t.cost for t in found.history if np.isfinite(t.cost)) < 2.5
    json.dumps(found.to_dict(), allow_nan=False)


def test_what_was_found_stays_when_the_user_stops_a_search(arm, tmp_path):
    said = []

    def stop(text):
        said.append(text)
        if len(said) == 3:
            raise KeyboardInterrupt

    found = mbdae.optimize(arm, uneven, STIFFNESS, drive="arm", span=(-1.0, 1.0), points=5, progress=stop)
    assert found.interrupted
    assert not found.converged
    assert len(found.history) == 3
    assert found.cost == min(t.cost for t in found.history)
    assert "stopped by the user" in str(found)
    found.save(tmp_path / "found.json")
    assert json.loads((tmp_path / "found.json").read_text())["values"] == found.values
    found.save(tmp_path / "found.csv")
    assert (tmp_path / "found.csv").read_text().splitlines()[0] == "parameter,start,value"
    shown = found._repr_html_()
    assert all(text in shown for text in (*STIFFNESS, "<table>", "stopped by the user"))
    assert "<svg" in found.plot()._repr_svg_()
    found.plot(tmp_path / "found.png")
    assert (tmp_path / "found.png").stat().st_size > 1000


def height(signals):
    return float(signals["q.rocker"][-1]), {"q.rocker": np.eye(1, len(signals["t"]), len(signals["t"]) - 1)[0]}


def unknown(signals):
    return signals["q.nothing"].sum(), {}


def infinite(signals):
    return np.inf, {}


G = {"gravity.2": -9.0}
TURN = {"drive": "crank", "span": (1.2, 2.2), "points": 5}
WRONG = [
    (height, G, {"search": "fastest"}, UnknownNameError, "unknown search 'fastest'"),
    (height, G, {"search": "L-BFGS-B", "constraints": {"a": (height, 0, 1)}}, InputError, "takes no constraints"),
    (height, G, {"bounds": {"gravity.1": (0, 1)}}, UnknownNameError, "gravity.1"),
    (height, G, {"bounds": {"gravity.2": (1, 0)}}, InputError, r"parameter 'gravity\.2' takes \(low, high\)"),
    (height, G, {"bounds": {"gravity.2": (-8, 0)}}, InputError, "outside its bounds -8 to 0"),
    (height, G, {"constraints": {"a": (height, 1, 0)}}, InputError, r"constraint 'a' takes \(low, high\)"),
    (height, G, {"constraints": {"a": 3}}, InputError, r"constraint 'a' takes \(function, low, high\), got 3"),
    (height, G, {"constraints": [(height, 0, 1)]}, InputError, "constraints are a table by name"),
    (height, G, {"bounds": [(-10, 0)]}, InputError, "bounds are a table by name"),
    (height, G, {"scales": {"gravity.1": 1.0}}, UnknownNameError, r"parameter 'gravity\.1'"),
    (height, G, {"scales": {"gravity.2": 0}}, InputError, r"scale of parameter 'gravity\.2' is a positive number"),
    (height, G, {"iterations": 0}, InputError, "iterations and tolerance are positive"),
    (None, G, {}, InputError, "a cost is a function of signals"),
    (height, "gravity.2", {}, InputError, "parameters are a list of names"),
    (height, {"gravity.x": 1.0}, {}, UnknownNameError, "gravity"),
    (unknown, G, {}, UnknownNameError, "q.nothing"),
    (infinite, G, {}, InputError, "cost 'infinite' is inf"),
    (unknown, G, TURN, UnknownNameError, "unknown signal of a curve 'q.nothing'"),
    (infinite, G, {"drive": "rocker", "points": 5}, InputError, "'rocker' reaches a dead point"),
    (uneven, {"joint.rocker.rpy.0": 0.0}, TURN, InputError, "violates redundant closures"),
]  # fmt: skip


@pytest.mark.parametrize(("cost", "parameters", "options", "error", "words"), WRONG)
def test_what_is_wrong_is_said_by_name(cost, parameters, options, error, words):
    run = {} if "drive" in options else {"t_span": (0.0, 0.1), "step": 0.05}
    with pytest.raises(error, match=words):
        mbdae.optimize("four_bar", cost, parameters, **{**run, **options})
