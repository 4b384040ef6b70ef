"""Derivatives of runs against Richardson differences of `solve` with fixed steps, and of runs with frozen steps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from frozen import assert_derivative, compare, free_velocity, quotient, repeated_run, runs_of
from smooth import SMOOTH

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.methods import METHODS, Tableau
from mbdae.solution.signals import signals as columns

METHODS_HERE = [name for name, method in METHODS.items() if isinstance(method, Tableau)]
SHORT = {"flexible_four_bar": (2e-3, 2e-4), "flexible_slider_crank": (2e-4, 2e-5),
         "andrews_squeezer": (0.01, 1e-3), "heavy_top": (0.1, 0.01), "humanoid_stance": (0.02, 2e-3),
         "flyball_governor": (0.01, 2e-4), "jansen_walker": (0.1, 5e-3), "n_four_bar": (0.3, 0.02),
         "sleeping_top": (0.02, 2e-3)}  # fmt: skip
FOUR_BAR = ("joint.crank.mass", "joint.coupler.com.0", "joint.rocker.xyz.0", "frame.coupler_tip.xyz.0", "start.v.crank")


@pytest.mark.parametrize("method", METHODS_HERE)
@pytest.mark.parametrize(("model", "name", "T", "step"), [("four_bar", "joint.crank.mass", 0.6, 0.05),
                                                          ("pendulum", "gravity.2", 1.0, 0.05)])  # fmt: skip
def test_every_method(model, name, T, step, method):
    template, value, run = runs_of(model, name, T, step=step, method=method)
    found = mbdae.sensitivity(run(value), [name], model=template)
    mech = found.trajectory.sol.mechanism
    assert_derivative(found.dy[..., 0], lambda x: run(x).y, value, 1e-11, mech=mech)


@pytest.mark.parametrize("name", FOUR_BAR)
def test_every_sort_of_parameter(name):
    template, value, run = runs_of("four_bar", name, 0.6, step=0.05, method="pherk5", project=True)
    sol = run(value)
    found = mbdae.sensitivity(sol, [name], model=template)
    assert_derivative(found.dy[..., 0], lambda x: run(x).y, value, 1e-11, mech=sol.mechanism)
    assert np.abs(found.v[-1]).max() > 0.1


@pytest.mark.parametrize("model", SMOOTH)
def test_every_model(model):
    """Gravity, and a velocity of the start that closures allow; projected."""
    mech = mbdae.load(model)
    T, step = SHORT.get(model, (0.2, 0.02))
    (q, v), free = mech.start, free_velocity(mech)

    @cache
    def run(x):
        return mbdae.solve(mech, (0.0, T), q, v + x * free, step=step, method="pherk5", project=mech.ng > 0)

    sol = run(0.0)
    assert sol.ended, sol.message
    found = mbdae.sensitivity(sol, start=True)
    along = found.dy[:, :, mech.nv : 2 * mech.nv] @ free
    assert_derivative(along, lambda x: run(x).y, 0.0, 1e-9, mech=mech)
    template, value, run = runs_of(model, "gravity.2", T, step=step, method="pherk5", project=mech.ng > 0)
    sol = run(value)
    found = mbdae.sensitivity(sol, ["gravity.2"], model=template)
    assert_derivative(found.dy[..., 0], lambda x: run(x).y, value, 1e-9, mech=sol.mechanism)


@pytest.mark.parametrize("method", ["pherk6", "herk4", "herk5"])
def test_controlled_runs_with_frozen_steps(method):
    """herk4 by step doubling; rows in use are fixed."""
    name = "joint.crank.mass"
    template, value, run = runs_of("four_bar", name, 0.7, rtol=1e-5, method=method)
    found = mbdae.sensitivity(run(value), [name], model=template)
    assert np.abs(repeated_run(found.trajectory, template.make({name: value})) - found.y).max() < 1e-11
    assert_derivative(found.dy[..., 0], lambda x: repeated_run(found.trajectory, template.make({name: x})), value,
                      1e-11, mech=found.trajectory.sol.mechanism)  # fmt: skip


def test_reselected_rows():
    mech = mbdae.load("bricard")
    sol = mbdae.solve(mech, (0.0, 6.0), step=0.05, method="pherk5")
    assert len(sol.in_use) > 1
    (q, v), free = mech.start, free_velocity(mech)
    found = mbdae.sensitivity(sol, start=True)
    along = found.dy[:, :, mech.nv : 2 * mech.nv] @ free

    @cache
    def run(x):
        out = mbdae.solve(mech, (0.0, 6.0), q, v + x * free, step=0.05, method="pherk5")
        assert out.in_use == sol.in_use
        return out.y

    assert_derivative(along, run, 0.0, 1e-9, (1e-5, 1e-4), mech=mech)


SIGNALS = ("q.crank", "force.pin", "v.coupler", "lam.pin.1", "lam.pin.3", "kinetic", "potential", "energy", "t",
           "a.rocker", "force.crank", "force.coupler.1", "force.pin.x", "torque.rocker")  # fmt: skip


def test_signals():
    name = "joint.coupler.mass"
    template, value, run = runs_of("four_bar", name, 0.4, step=0.05, method="pherk6", project=True)
    found = mbdae.sensitivity(run(value), [name], model=template)
    values = cache(lambda x: columns(run(x), SIGNALS))
    for signal in SIGNALS:
        assert_derivative(found.signal(signal)[:, 0], lambda x, s=signal: values(x)[s], value, 1e-10, what=signal)
    np.testing.assert_allclose(found.signal("lam.pin.1"), found.lam[:, 0])


@pytest.mark.parametrize(
    ("model", "name", "T", "signals"),
    [
        ("stewart_platform", "gravity.2", 0.04, ("force.{}", "torque.{}.1")),
        ("andrews_squeezer", "force.spring.stiffness", 2e-3, ("force.gamma", "force.K2-K3.y", "force.epsilon.x")),
        ("car_axis", "gravity.2", 0.05, ("force.{}.z",)),
    ],
)
def test_forces_and_torques(model, name, T, signals):
    """In all joints and closures: springs between frames, drivers, and redundant rows."""
    template, value, run = runs_of(model, name, T, step=T / 2, method="pherk5")
    sol, values = run(value), cache(lambda x: run(x).signals())
    found, known = mbdae.sensitivity(sol, [name], model=template), sol.signals()
    joint = sol.mechanism.joint_names[-1]
    for signal in (s.format(joint) for s in signals):
        signal = signal if signal in known else signal.rpartition(".")[0]
        size = max(1.0, np.abs(known[signal]).max())
        moved = found.signal(signal)[:, 0] / size
        assert_derivative(moved, lambda x, s=signal, n=size: values(x)[s] / n, value, 1e-9, what=signal)
        assert np.abs(moved).max() > 1e-9, signal


def test_a_placement_that_cannot_be_moved_far():
    """Assembly fails where a joint of a small mechanism is moved by centimetres; the held coordinates determine all."""
    name, template = "joint.beta.xyz.0", Template("andrews_squeezer")
    sol = mbdae.solve(template.make({}), (0.0, 1e-4), step=1e-4)
    found = mbdae.sensitivity(sol, [name], model=template)
    expected = quotient(lambda x: template.make({name: x}).start[0], 0.0, 3e-5)
    np.testing.assert_allclose(found.q[0, :, 0], expected, rtol=0, atol=1e-5)
    assert np.abs(expected).max() > 10


def test_the_time_of_an_event_is_differentiated():
    name = "start.q.crank"
    event = mbdae.Event(lambda t, q, v: q[0] - 1.0, terminal=True)
    template, value, run = runs_of("four_bar", name, 2.0, step=0.05, method="pherk6", events=event)
    found = mbdae.sensitivity(run(value), [name], model=template, event=event)
    for part, of in ((found.dy[-1, :-1, 0], lambda x: run(x).y[-1][:-1]), (found.dt[-1], lambda x: run(x).t[-1:])):
        assert_derivative(part, of, value, 1e-11)
    assert abs(found.q[-1, 0, 0]) < 1e-13
    with pytest.raises(InputError, match="event="):
        mbdae.sensitivity(run(value), [name], model=template)


@pytest.mark.parametrize(
    ("text", "name"),
    [("q.crank = 1.0", "start.q.crank"), ("position.coupler_tip.z < 1.2", "frame.coupler_tip.xyz.0"),
     ("potential < 33", "joint.rocker.mass"), ("force.pin > 10", "joint.coupler.mass")],
)  # fmt: skip
def test_the_time_of_an_event_on_a_signal_is_differentiated(text, name):
    """Signals depend on parameters directly; forwards and back."""
    event = mbdae.Event(text, terminal=True)
    template, value, run = runs_of("four_bar", name, 2.0, step=0.05, method="pherk6", events=event)
    sol = run(value)
    assert sol.status == "event"
    found = mbdae.sensitivity(sol, [name], model=template, event=event)
    assert_derivative(found.dt[-1], lambda x: run(x).t[-1:], value, 1e-10)
    compare(sol, [name], ("t", "v.crank"), model=template, event=text)


def test_a_sampled_controller():
    """Its torques jump; they depend on q and v just before."""
    hold = mbdae.Sampled(lambda t, q, v, x: (-5 * v[:1] - np.sin(q[0]) - x, x + 0.1 * q[:1]), rate=10,
                         joints="crank", memory={"sum": 0.2}, name="hold")  # fmt: skip
    mech = mbdae.load("four_bar", forces=[hold])
    q, _ = mech.start

    @cache
    def run(x):
        start = mech.assemble(q, {"crank": x})
        return mbdae.solve(mech, (0.0, 0.55), *start, step=0.02, method="pherk5")

    sol = run(0.3)
    found = mbdae.sensitivity(sol, start=True)
    dv = quotient(lambda x: mech.assemble(q, {"crank": x})[1], 0.3, 1e-2)
    along = found.dy[:, :, mech.nv : 2 * mech.nv] @ dv
    assert_derivative(along, lambda x: run(x).y, 0.3, 1e-11, (1e-3, 3e-3, 1e-2), mech=mech)
    assert np.abs(found.s).max() > 0.1


def test_jumps_of_a_run_that_ends_long_before_its_span():
    """The two nodes of a jump are roundings of the end of the span apart."""
    hold = mbdae.Sampled(lambda t, q, v: -5 * v[:1] - np.sin(q[0]), rate=10, joints="crank", name="hold")
    mech, end = mbdae.load("four_bar", forces=[hold]), mbdae.Event("t > 0.35", terminal=True)
    found = [
        mbdae.sensitivity(mbdae.solve(mech, (0.0, span), step=0.02, method="pherk5", events=end), start=True, event=end)
        for span in (0.4, 100.0)
    ]
    np.testing.assert_allclose(found[1].dy[-1], found[0].dy[-1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("method", ["pherk5", "radau5"])
def test_steps_of_a_few_roundings_of_a_late_time_are_no_jumps(method):
    """A start 34 years after t = 0, where 32 roundings of t are 8 microseconds."""
    mech, step = mbdae.load("pendulum"), 2.0**-17
    runs = [mbdae.solve(mech, (t0, t0 + 8 * step), step=step, method=method) for t0 in (0.0, 2.0**30)]
    found, late = (mbdae.sensitivity(sol, start=True).dy for sol in runs)
    np.testing.assert_allclose(late, found, rtol=0, atol=1e-14)
    assert np.abs(np.diff(found, axis=0)).max() > 1e-6


@cache  # the same values for every run and back end
def _controlled(ki, integral=0.2):
    sampled = mbdae.JointPID(name="sampled", joint="crank", reference=0.5, kp=3.0, ki=ki, kd=0.5, rate=20.0,
                             integral=integral)  # fmt: skip
    steady = mbdae.JointPID(name="steady", joint="crank", reference=0.3, kp=2.0, ki=7.0, kd=0.1)
    return mbdae.load("four_bar", forces=[sampled, steady])


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("T", [0.02, 0.08, 0.55])
@pytest.mark.parametrize("given", [(), ([0.0, 0.3, 0.1],)])
def test_a_sampled_controller_with_its_gains(T, given):
    """At the first instant it uses the integral of the start, and not the updated one."""
    own = _controlled(40.0)
    start = (*own.start, *given) if given else ()

    @cache
    def run(**values):
        return mbdae.solve(_controlled(**{"ki": 40.0} | values), (0.0, T), *start, step=0.02, method="pherk5")

    values = {"ki": 40.0, "integral": 0.2}
    sol = run()
    found = mbdae.sensitivity(sol, values, model=_controlled)
    for i, (name, value) in enumerate(values.items()):
        assert_derivative(found.dy[..., i], lambda x, name=name: run(**{name: x}).y, value, 1e-11, mech=own, what=name)
    assert np.abs(found.s[0, 0, 0] - sol.settings["s"][1]) < 1e-12  # tau = ki s + ..., with s before the instant
    compare(sol, values, ("q.crank", "v.rocker", "energy"), model=_controlled)


def test_times_between_nodes():
    """Short steps of the method: near the dense output, and differentiable."""
    mech = mbdae.load("four_bar")
    times = np.linspace(0.0, 0.5, 7)
    sol = mbdae.solve(mech, (0.0, 0.5), step=0.05, method="pherk6", t_eval=times)
    found = mbdae.sensitivity(sol, ["joint.crank.mass"])
    assert 0 < np.abs(found.y - sol.y).max() < 1e-5
    dense = mbdae.sensitivity(mbdae.solve(mech, (0.0, 0.5), step=0.05, method="pherk6"), ["joint.crank.mass"])
    np.testing.assert_array_equal(found.dy[0], dense.dy[0])
    np.testing.assert_allclose(found.dy[-1], dense.dy[-1], rtol=1e-13)


def test_what_has_no_derivative_is_rejected_by_name():
    mech = mbdae.load("four_bar")
    sol = mbdae.solve(mech, (0.0, 0.1), step=0.05)
    with pytest.raises(InputError, match=r"'joint\.rocker\.rpy\.0' violates redundant closures"):
        mbdae.sensitivity(sol, ["joint.rocker.rpy.0"])
    with pytest.raises(UnknownNameError, match="no_joint"):
        mbdae.sensitivity(sol, ["joint.no_joint.mass"])
    with pytest.raises(InputError, match=r"top is a body of the file, name body\.top\.mass"):
        Template("heavy_top").check({"joint.top.mass": 1.0})
    with pytest.raises(InputError, match="'Gv' has no gradient"):
        mbdae.sensitivity(sol, ["joint.crank.mass"]).signal("Gv")
    with pytest.raises(UnknownNameError, match="signal"):
        mbdae.sensitivity(sol, ["joint.crank.mass"]).signal("q.nothing")
    with pytest.raises(InputError, match="a signal is given by its name"):
        mbdae.sensitivity(sol, ["joint.crank.mass"]).signal(["q.crank"])
    with pytest.raises(InputError, match="a name, a path, tables or a function that returns one, got 3"):
        mbdae.sensitivity(sol, {"mass": 1.0}, model=3)
    baseline = mbdae.solve(mech, (0.0, 0.1), formulation="index1", method="dop853")
    with pytest.raises(InputError, match="half-explicit"):
        mbdae.sensitivity(baseline, ["joint.crank.mass"])
    for names, words in (([3], "dotted names, as 'gravity.2' or 'joint.crank.mass', got 3"), (3, "a list of names"),
                         ((), "takes parameters, .* or start=True"), (None, "got None"), (0, "got 0"),
                         (["gravity.2", "gravity.2"], "'gravity.2' is named twice"),
                         (["joint.crank"], "joint.crank is a joint: name an entry of it, .*mass"),
                         ({"gravity.2": None}, "'gravity.2' is a finite number, got None")):  # fmt: skip
        with pytest.raises(InputError, match=words):
            mbdae.sensitivity(sol, names)
    with pytest.raises(InputError, match="not read from files"):
        mbdae.sensitivity(mbdae.solve(mbdae.Mechanism(mech.model), (0.0, 0.1), step=0.05), ["gravity.2"])


@pytest.mark.usefixtures("back_end")
def test_runs_that_share_a_workspace_keep_their_rows():
    """Multipliers are computed on demand: here after another run, with other rows in use."""
    sol = mbdae.solve(mbdae.load("bricard"), (0.0, 0.1), step=0.02, method="pherk5")
    (_, rows), other = sol.in_use[0], (0, 1, 2, 3)
    assert len(sol.in_use) == 1
    assert rows != other
    alone = mbdae.sensitivity(sol, ["gravity.2"]).lam
    first = mbdae.sensitivity(sol, ["gravity.2"])
    second = mbdae.sensitivity(replace(sol, in_use=[(0, other)]), ["gravity.2"])
    assert first.trajectory.system is second.trajectory.system
    assert (first.lam == alone).all()
    np.testing.assert_allclose(second.lam, alone, rtol=0, atol=1e-10 * np.abs(alone).max())
