"""`mbdae.optimal_control` against closed forms, and against collocation of a four-bar's reduced equation."""

import json

import numpy as np
import pinocchio as pin
import pytest
from chains import rod

import mbdae
from mbdae import Input, JointTorque, Mechanism

MASS = 2.0
COLLOCATION = 167.076509  # of the four-bar's Lagrangian in one coordinate, degree 4, by another program


def slider(hold="first", name="push"):
    """A mass on a rail, pushed by an input: MASS x'' = u."""
    model = pin.Model()
    model.gravity.linear[:] = 0.0
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    model.appendBodyToJoint(j, pin.Inertia(MASS, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Mechanism(model, forces=[JointTorque(joint="rail", torque=Input(name=name, unit="N", hold=hold))])


def four_bar(hold="first"):
    m = mbdae.load("four_bar")
    torque = JointTorque(joint="crank", torque=Input(name="motor", unit="N m", hold=hold))
    return Mechanism(m.model, m.closures, [torque], start=m.start_values)


SQUARES = {"push": 1.0}
END = {"q.rail": 1.0, "v.rail": 0.0}


def control(cost=SQUARES, end=END, inputs=("push",), hold="first", **options):
    return mbdae.optimal_control(slider(hold), cost, inputs, **{"end": end, "duration": 1.0, "points": 9, **options})


def test_rest_to_rest_with_least_squares():
    """The force is linear: 6 m d/T^2 (1 - 2 t/T), and its cost 12 m^2 d^2/T^3."""
    found = control(duration=2.0)
    assert found.converged
    assert found.cost == pytest.approx(12 * MASS**2 / 8, rel=1e-9)
    assert found.inputs["push"] == pytest.approx(6 * MASS / 4 * (1 - found.t), abs=1e-5)
    assert found.solution.q[-1] == pytest.approx([1.0], abs=1e-9)
    assert found.duration == 2.0


@pytest.mark.slow
def test_a_free_duration():
    """Least w T + 12 m^2 d^2/T^3: T = (36 m^2 d^2/w)^(1/4)."""
    found = control(lambda x: (x["push"] ** 2, {"push": 2 * x["push"]}), duration=(0.5, 5.0), time_weight=10.0)
    T = (36 * MASS**2 / 10.0) ** 0.25
    assert found.duration == pytest.approx(T, rel=1e-3)  # the cost is flat there
    assert found.cost == pytest.approx(10 * T + 12 * MASS**2 / T**3, rel=1e-7)


def test_least_time_is_bang_bang():
    """With a force between -3 and 3 N, T = 2 sqrt(m d/3)."""
    found = control({"push": 0.0}, inputs={"push": (-3.0, 3.0)}, hold="zero", duration=(0.5, 5.0), time_weight=1.0)
    assert found.converged
    assert found.duration == pytest.approx(2 * np.sqrt(MASS / 3), rel=1e-6)
    assert found.inputs["push"][:-1] == pytest.approx([3.0] * 4 + [-3.0] * 4, abs=1e-4)
    assert len(found.t) == 9


def test_a_path_bound():
    """A speed of at most 1.2: linear forces over 1/4 s at both ends, none between, cost 8 m^2 V^2/(3 t_1)."""
    found = control(path={"v.rail": (None, 1.2)})
    assert found.signals["v.rail"].max() == pytest.approx(1.2, abs=1e-6)
    assert found.signals["v.rail"][-1] == pytest.approx(0.0, abs=1e-6)
    assert found.cost == pytest.approx(MASS**2 * 8 * 1.2**2 / 0.75, rel=1e-6)


def test_signals_as_costs():
    """The integral of v is the distance; work at the end is the kinetic energy."""
    found = control("v.rail", {"v.rail": 2.0}, {"push": (-30, 30)}, path={"q.rail": (-0.3, None)})
    assert found.cost == pytest.approx(found.signals["q.rail"][-1], abs=1e-9)
    assert found.cost == pytest.approx(-0.3 + MASS * 2.0**2 / (2 * 30), abs=1e-3)  # from rest with the largest force
    assert found.solution.work[-1] == pytest.approx(0.5 * MASS * 4.0, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_the_optimum_of_a_four_bar(hold):
    """Crank 1.2 to 0.6 rad, rest to rest in 1 s: piecewise functions converge to collocation, with order 2 or 4."""
    found = [
        mbdae.optimal_control(
            four_bar(hold), {"motor": 1.0}, ["motor"], end={"q.crank": 0.6, "v.crank": 0.0}, duration=1.0, points=n
        )
        for n in ((17, 33) if hold == "first" else (9, 17))
    ]
    excess = [x.cost - COLLOCATION for x in found]
    assert all(x.converged for x in found)
    assert min(excess) > 0
    assert np.log2(np.divide(excess[:-1], excess[1:])) == pytest.approx(4 if hold == "first" else 2, abs=0.3)
    if hold == "first":
        assert excess[-1] < 1e-5 * COLLOCATION
    assert np.abs(mbdae.load("four_bar").residual(found[-1].solution.q[-1], found[-1].solution.v[-1])[0]).max() < 1e-6


@pytest.mark.slow
def test_derivatives_are_quotients_of_motions():
    """Of costs and constraints that depend on inputs, states and accelerations, with a free duration."""
    from mbdae.finite_differences import numerical_jacobian
    from mbdae.integrate.simulator.simulator import Simulator
    from mbdae.studies.optimal_control.controlled_motion import Grid, Shooting
    from mbdae.studies.optimal_control.cost import Integral, SignalAtPoint, integrand

    function, used, name = integrand({"motor": 1.0, "a.rocker": 0.1, "energy": 0.01})
    for hold in ("zero", "first"):
        grid = Grid(("motor",), ("motor",) * (hold == "first"), 4, 2, None)
        shooting = Shooting(Simulator(four_bar(hold), step=1.0, method="herk5", restart=True), grid, [*used, "a.crank"])
        z0 = np.array([*np.linspace(1.0, 3.0, len(grid.unknowns()) - 1), 0.4])
        functions = Integral(function, name, 2.0), SignalAtPoint("a.crank", 2), SignalAtPoint("a.crank", 3)

        def values(dz, grid=grid, shooting=shooting, z0=z0, functions=functions):
            motion = shooting(dict(zip(grid.unknowns(), z0 + dz, strict=True)))
            return [f(motion) for f in functions]

        found = np.array([gradient for _, gradient in values(0.0)])
        quotients = numerical_jacobian(lambda dz: np.array([x for x, _ in values(dz)]), len(z0), 1e-3)
        assert found == pytest.approx(quotients, abs=1e-9 * np.abs(quotients).max())


def test_results(tmp_path):
    found = control(q=[0.25], end={"q.rail": (1.0, 1.5), "v.rail": 0.0})
    assert found.signals["q.rail"][[0, -1]] == pytest.approx([0.25, 1.0], abs=1e-6)  # the nearer limit
    assert json.loads(json.dumps(found.to_dict()))["converged"]
    assert str(found).startswith("optimal control of ")
    assert list(found.to_columns().values) == ["t", "push", "q.rail", "v.rail"]
    found.plot(tmp_path / "control.png")
    assert (tmp_path / "control.png").exists()


def test_an_end_out_of_reach_is_said():
    found = control(inputs={"push": (-0.1, 0.1)}, iterations=3)
    assert not found.converged
    assert "violated" in found.message
    assert "not an optimum" in str(found)


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"inputs": ["pull"]}, "pull.*push"),
        ({"inputs": []}, "push"),
        ({"inputs": "push"}, "list of names"),
        ({"inputs": {"push": (2.0, 1.0)}}, "low <= high"),
        ({"inputs": {"push": (1.0, 2.0)}}, "push.0.*outside its bounds"),
        ({"cost": {}}, "a cost is"),
        ({"cost": "speed"}, "speed"),
        ({"cost": "g"}, "no gradient"),
        ({"cost": lambda x: x["push"]}, "returns"),
        ({"cost": lambda x: (x["push"] * np.nan, {})}, "finite"),
        ({"cost": lambda x: (x["push"] ** 2, {"push": x["push"][:1]})}, "respect to 'push' must be 24 finite numbers"),
        ({"cost": lambda x: (x["push"], {"L": x["push"]})}, "respect to 'L', which it does not use"),
        ({"cost": lambda x: (x["push"][1], {})}, "failed at one node, n = 1"),
        ({"end": {"q.rial": 1.0}}, "q.rail"),
        ({"end": {"q.rail": "far"}}, "low, high"),
        ({"path": {"q.rail": 1.0}}, "low, high"),
        ({"duration": -1.0}, "duration"),
        ({"duration": (2.0, 1.0)}, "duration"),
        ({"points": 1}, "points"),
        ({"steps": 3}, "even"),
        ({"guess": {"push": np.nan}}, "guess"),
        ({"guess": {"push": [1.0, 2.0]}}, "9 of them"),
        ({"guess": {"pull": 1.0}}, "pull.*push"),
        ({"rtol": 1e-8}, "rtol.*method"),
        ({"method": "rattle2"}, "herk|half-explicit"),
        ({"q": [np.nan]}, "q"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"end": {"q.rail": np.array(1.0)}}, "signal 'q.rail' takes"),
        ({"duration": np.array(1.0)}, "duration"),
    ],
)
def test_wrong_use_is_one_line(wrong, match):
    with pytest.raises(mbdae.MbdaeError, match=rf"^[^\n]*({match})[^\n]*$"):
        control(**wrong)


def test_an_input_between_equal_limits_is_fixed():
    """The search has unknowns without a range."""
    found = control(inputs={"push": (3.0, 3.0)}, guess={"push": 3.0}, end=None)
    np.testing.assert_array_equal(found.inputs["push"], 3.0)
    assert found.cost == pytest.approx(9.0, rel=1e-12)


def test_counts_may_be_integers_of_numpy():
    found = control(points=np.int64(9), steps=np.int32(2), iterations=np.int64(200))
    assert found.cost == pytest.approx(control().cost, rel=1e-14)


def test_a_model_without_inputs():
    model = pin.Model()
    rod(model, 0, pin.SE3.Identity(), 1.0, "arm")
    with pytest.raises(mbdae.MbdaeError, match="motor"):
        mbdae.optimal_control(Mechanism(model), "q.arm", ["motor"], duration=1.0)


def test_an_input_may_have_the_name_of_the_integrand():
    """Its derivative is checked, and so is L."""
    with pytest.raises(mbdae.MbdaeError, match="L must be 24 finite numbers"):
        mbdae.optimal_control(slider(name="L"), lambda x: (np.nan * x["L"], {"L": x["L"]}), ["L"], duration=1, points=9)
