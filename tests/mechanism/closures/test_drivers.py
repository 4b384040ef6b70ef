"""Drivers: motions, starts, orders with time-dependent constraints, energy, every formulation."""

import re

import numpy as np
import pinocchio as pin
import pytest
from driven import DRIVEN, crane, linkage

import mbdae
from mbdae import Driver, finite_differences
from mbdae.errors import AssemblyError, InputError
from mbdae.mechanism.formats.mechanism_file.schema import read_toml
from mbdae.mechanism.model_settings import Start
from mbdae.methods import method

POINTS = [(0.0, 0.1), (0.5, 0.4), (1.2, -0.3), (2.0, 0.2)]
MOTIONS = {
    "speed": Driver.at_speed("a", 2.0, start=0.3),
    "harmonic": Driver.harmonic("a", 0.4, 3.0, phase=0.2, offset=0.1),
    "polynomial": Driver.polynomial("a", (0.1, -0.4, 0.7, 0.2)),
    "table": Driver.table("a", POINTS, beyond="linear"),
    "held table": Driver.table("a", POINTS, beyond="hold"),
    "periodic table": Driver.table("a", POINTS, beyond="periodic"),
    "function": Driver.function("a", np.sin, np.cos, lambda t: -np.sin(t)),
}


@pytest.mark.parametrize("kind", MOTIONS)
def test_motions_have_their_derivatives(kind):
    driver = MOTIONS[kind]
    for t in (-0.7, 0.1, 0.77, 1.6, 2.9):
        for k in (0, 1):
            slope = finite_differences.numerical_derivative(lambda s, t=t, k=k: driver.follow(t + s)[k], 1e-2)
            assert slope == pytest.approx(driver.follow(t)[k + 1], abs=1e-9)


def test_a_table_interpolates_its_points_and_continues_linearly():
    driver = MOTIONS["table"]
    assert [driver.follow(t)[0] for t, _ in POINTS] == pytest.approx([u for _, u in POINTS], abs=1e-14)
    (u1, speed, bend), (u2, *_) = driver.follow(2.0), driver.follow(2.5)
    assert (u2, bend) == pytest.approx((u1 + 0.5 * speed, 0), abs=1e-13)


def test_rejections():
    with pytest.raises(InputError, match="needs rate and acceleration"):
        Driver(joint="a", motion=np.sin)
    with pytest.raises(InputError, match="cannot follow steps"):
        Driver(joint="a", motion={"kind": "steps", "points": [(0.0, 1.0)]})
    with pytest.raises(InputError, match="one of joint, joints and frames"):
        Driver(joint="a", frames=("b", "c"), motion=1.0)
    with pytest.raises(InputError, match="needs coefficients"):
        Driver(joints=("b", "c"), motion=1.0)
    with pytest.raises(InputError, match="joins 'b' with itself"):
        Driver(frames=("b", "b"), motion=1.0)
    wrong = Driver.function("crank", np.sin, np.cos, np.sin)
    with pytest.raises(InputError, match=r"acceleration of driver .crank driver. is 0.001 at t = .*, but .*-0.001"):
        mbdae.load("four_bar", drivers=[wrong]).assemble()
    with pytest.raises(InputError, match="need different names"):
        mbdae.load("four_bar", drivers=[Driver.at_speed("crank", 1.0), Driver.at_speed("crank", 1.0)])


@pytest.mark.parametrize(("k", "what"), [(1, "rate"), (2, "acceleration")])
def test_derivatives_that_become_wrong_during_the_run_are_named(k, what):
    right = (lambda t: 1.2 + np.sin(t), np.cos, lambda t: -np.sin(t))
    spoiled = [lambda t, i=i: right[i](t) + 0.01 * (t > 0.6) * (i == k) for i in range(3)]
    mech = mbdae.load("four_bar", drivers=[Driver.function("crank", *spoiled)])
    sol = mbdae.solve(mech, (0, 1), *mech.assemble({}, {}), rtol=1e-4)
    assert sol.status == "driver"
    assert f"the {what} of driver 'crank driver' is" in sol.message
    assert 0.6 < float(sol.message.split("t = ")[1].split(" s")[0]) < 0.65
    assert sol.t[-1] >= 0.6 - 1e-9
    assert mbdae.solve(mech, (0, 0.6), *mech.assemble({}, {}), rtol=1e-4).success


def test_a_later_wrong_derivative_is_not_the_cause():
    right = (lambda t: 1.2 + np.sin(t), np.cos, lambda t: -np.sin(t))
    spoiled = [lambda t, i=i: right[i](t) + 0.01 * (t > 0.6) * (i == 1) for i in range(3)]
    mech = mbdae.load("four_bar", drivers=[Driver.function("crank", *spoiled)])
    sol = mbdae.solve(mech, (0, 1), *mech.assemble({}, {}), rtol=1e-4, max_step=1e-2, max_steps=20)
    assert sol.t[-1] < 0.3
    assert sol.status == "max_steps"


def test_a_jump_of_the_acceleration_is_no_wrong_derivative():
    """u = t^2 / 2 to t = 0.5, and straight from there: the difference quotient of u'' fails at one time only."""
    early = Driver.function(
        "crank",
        lambda t: 1.2 + (t * t / 2 if t < 0.5 else t / 2 - 0.125),
        lambda t: min(t, 0.5),
        lambda t: float(t < 0.5),
    )
    mech = mbdae.load("four_bar", drivers=[early])
    sol = mbdae.solve(mech, (0, 1), *mech.assemble({}, {}), jumps=[0.5], rtol=1e-6)
    assert sol.status == "finished", sol.message


FILE = """
[[driver]]
joint = "crank"
motion = {{ kind = "harmonic", {key} = 0.3, omega = 2.0 }}
"""


def test_a_file_names_its_known_keys():
    assert read_toml(FILE.format(key="amplitude"), "x").driver == (Driver.harmonic("crank", 0.3, 2.0),)
    with pytest.raises(InputError, match=re.escape("known: amplitude, kind, offset, omega, phase")):
        read_toml(FILE.format(key="amplitude = 0.3, size"), "x")
    with pytest.raises(InputError, match="known: coefficients, frames, joint, joints, motion, name"):
        read_toml('[[driver]]\njoin = "crank"\nmotion = 1.0', "x")


@pytest.mark.parametrize("name", DRIVEN)
@pytest.mark.parametrize("t", [0.0, 0.7, -3.0])
def test_the_start_is_consistent_at_its_time(name, t):
    mech = DRIVEN[name]()
    g, Gv = mech.residual(*mech.start_at(t), t)
    assert np.abs(g).max() < 1e-11
    assert np.abs(Gv).max() < 1e-12
    sol = mbdae.solve(mech, (t, t + 0.1), rtol=1e-8)
    assert sol.success
    np.testing.assert_allclose(sol.q[0], mech.start_at(t)[0], rtol=0, atol=1e-11)


def test_inconsistent_starts_are_rejected_by_name():
    mech = linkage()
    with pytest.raises(AssemblyError, match=r"is violated by .* \(fixed: crank; driven by 'crank driver'\)"):
        mech.assemble(q={"crank": 0.5})
    with pytest.raises(InputError, match=r"'crank driver' is violated by .*assemble\(q, v, t=0.4\)"):
        mbdae.solve(mech, (0.4, 1.0), *mech.start)


CASES = {  # duration, and numbers of steps for the higher orders; twice as many for the others
    "crane": (0.8, (24, 40, 64, 96, 144)),
    "platform": (0.8, (24, 40, 64, 96, 144)),
    "linkage": (0.6, (64, 96, 136, 192)),
}
T0, OUT = 0.3, 8


def sample(sol):
    """q, v, lam of the method, hidden lam and the work at eight times."""
    at = np.arange(1, OUT + 1) * ((len(sol.t) - 1) // OUT)
    hidden = np.array([sol.system.derivative(sol.t[i], sol.y[i])[1] for i in at])
    return sol.q[at], sol.v[at], sol.lam_own[at], hidden, sol.work[at]


@pytest.fixture(scope="module", params=CASES)
def reference(request):
    mech, (T, ns) = DRIVEN[request.param](), CASES[request.param]

    def run(name, n, backend="auto"):
        return sample(mbdae.solve(mech, (T0, T0 + T), method=name, step=T / n, backend=backend))

    q, v, _, lam, work = best = run("pherk6", 720)
    other = run("herk5", 1280)
    assert all(np.abs(best[k] - other[k]).max() < 1e-12 for k in (0, 1, 3, 4))
    return run, ns, (q, v, lam, lam, work)


@pytest.mark.parametrize("name", ["pherk6", "pherk5", "herk5", "arnold4", "pherk3"])
@pytest.mark.parametrize("backend", ["native", "python"])
def test_orders_with_time_dependent_constraints(name, reference, backend):
    run, ns, exact = reference
    m = method(name)
    p = m.order_linear
    ns = ns if p > 4 else [2 * n for n in ns]
    runs = [run(name, n, backend if n <= ns[1] else "auto") for n in ns]  # short steps by the core, if there is one
    errors = np.array([[np.abs(a - b).max() for a, b in zip(found, exact, strict=True)] for found in runs])
    slopes = -np.polyfit(np.log(ns), np.log(errors), 1)[0]
    for what, slope, claim in zip(("q", "v", "own lam", "lam", "work"), slopes, (p, p, m.order_own, p, p), strict=True):
        assert slope >= claim - 0.2, f"{what}: {slopes}"


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("name", DRIVEN)
@pytest.mark.parametrize("options", [{}, {"project": True}, {"formulation": "ggl"}], ids=str)
def test_the_drivers_work_closes_the_energy_balance(name, options):
    sol = mbdae.solve(DRIVEN[name](), (T0, T0 + 0.4), method="pherk6", rtol=1e-10, **options)
    drift = mbdae.drift(sol)
    assert sol.success
    assert np.abs(sol.work).max() > 1e-2
    assert drift.energy_relative < 1e-9
    assert drift.g_max < (1e-12 if options else 1e-8)
    assert drift.Gv_max < 1e-12
    middle = sol.point(0.5 * (sol.t[3] + sol.t[4]))  # the work in the dense output
    mech = sol.mechanism
    q, v = middle[: mech.nq], middle[mech.nq : mech.nq + mech.nv]
    change = sum(mech.energy(q, v)) - sum(mech.energy(sol.q[0], sol.v[0]))
    assert middle[-1] == pytest.approx(change, abs=1e-8 * drift.energy_scale)


@pytest.mark.usefixtures("back_end")
def test_all_formulations_and_methods_agree():
    q = [
        mbdae.solve(crane(), (T0, T0 + 0.2), method=name, rtol=1e-9, **options).q[-1]
        for name, options in {
            "pherk5": {},
            "herk4": {},
            "hedop5": {},
            "radau5": {},
            "radau7": {"formulation": "ggl"},
            "DOP853": {"formulation": "index1"},
        }.items()
    ]
    assert np.ptp(q, axis=0).max() < 1e-6


@pytest.mark.usefixtures("back_end")
def test_no_degree_of_freedom_is_legal():
    mech = linkage()
    sol = mbdae.solve(mech, (0, 1), rtol=1e-9)
    assert sol.success
    crank = [mech.drivers[0].follow(t) for t in sol.t]
    assert sol.q[:, 0] == pytest.approx([u for u, *_ in crank], abs=1e-8)
    assert sol.v[:, 0] == pytest.approx([du for _, du, _ in crank], abs=1e-13)


@pytest.mark.usefixtures("back_end")
def test_a_length_driven_to_nothing_stops_by_name():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "load")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addFrame(pin.Frame("hook", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    winch = Driver.at_speed(("world", "hook"), -2.0, start=1.3, name="winch")
    mech = mbdae.Mechanism(model, drivers=[winch], start=Start(guess={"load": (0.0, 0.0, -1.0)}))
    sol = mbdae.solve(mech, (0, 1), rtol=1e-6)
    assert sol.status == "driver"
    assert "driver 'winch' requires a distance of" in sol.message
    assert sol.t[-1] == pytest.approx(0.65, abs=1e-3)
