"""Signals for events: the columns of a solution at a point, computed once for all events, without effect on the run."""

import numpy as np
import pinocchio as pin
import pytest
from linkages import bar, point
from shared import shared_model
from smooth import SMOOTH

import mbdae
from mbdae.solution.signal_value import signal_values, value
from mbdae.solution.work_columns import WORK


@pytest.mark.native
def test_evaluating_signals_does_not_change_a_run():
    """To the last bit, with changes of rows in use and points close to one another."""
    mech = shared_model("bricard")
    lam = next(n for n in signal_values(mech) if n.startswith("lam."))
    for options in ({"formulation": "ggl"}, {"method": "radau5"}, {"step": 0.01}):
        events = (), (f"{lam} = 1e9", "kinetic = -1")
        plain, with_events = (mbdae.solve(mech, (0, 5), events=e, **options) for e in events)
        assert with_events.in_use == plain.in_use
        np.testing.assert_array_equal(with_events.y, plain.y)


@pytest.mark.native
def test_forces_at_a_point_are_found_once_for_all_events():
    calls = []
    mech = mbdae.load("four_bar", forces=[lambda t, q, v: calls.append(t) or 0 * v])
    names = [n for n, s in signal_values(mech).items() if s.kind in ("lam", "force", "torque", "rate")]
    used = []
    for some in (names[:1], names):
        calls.clear()
        mbdae.solve(mech, (0, 0.5), step=0.01, events=[f"{n} = 1e9" for n in some])
        used.append(len(calls))
    assert used[1] - used[0] < len(names)  # at the start, in Python


@pytest.mark.usefixtures("back_end")
def test_multipliers_are_those_of_the_hidden_constraint():
    """Without the contribution of Baumgarte's terms to those of the steps: as in `Solution.lam`."""
    mech, options = shared_model("four_bar"), {"formulation": "index1", "method": "dop853", "baumgarte": (20.0, 20.0)}
    lam = mbdae.solve(mech, (0, 1), rtol=1e-4, **options).signals("lam.pin.1")["lam.pin.1"]
    level = float(lam[0] + lam.max()) / 2
    sol = mbdae.solve(mech, (0, 1), rtol=1e-4, events=f"lam.pin.1 = {level!r}", **options)
    system, signal = mech.system(), signal_values(mech)["lam.pin.1"]
    assert len(sol.events[0][0])
    for t, y in zip(*sol.events[0], strict=True):
        assert value(system, signal, t, y) == pytest.approx(level, abs=1e-10)


@pytest.mark.usefixtures("back_end")
def test_multipliers_are_those_of_nodes_where_the_first_joint_slides():
    """The last stage puts the constraint on another pose than that of the node: the cart is elsewhere."""
    model = pin.Model()
    cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(cart, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    bar(model, bar(model, cart, (0, 0), 1.0, "arm"), (1, 0), 1.5, "rod")
    point(model, 0, (1.5, -0.9), "ground")
    mech = mbdae.Mechanism(model, [mbdae.Closure.point("rod_tip", "ground", name="pin")])
    q, v = mech.assemble(q={"arm": 0.5}, v={"arm": 2.0}, guess={"rod": -1.7})
    options = {"method": "pherk6", "step": 0.05}
    lam = mbdae.solve(mech, (0, 0.5), q, v, **options).lam[:, 0]
    sol = mbdae.solve(mech, (0, 0.5), q, v, events=f"lam.pin.1 = {float(lam[5])!r}", **options)
    system, signal = mech.system(), signal_values(mech)["lam.pin.1"]
    assert len(sol.events[0][0])
    for t, y in zip(*sol.events[0], strict=True):
        assert value(system, signal, t, y) == pytest.approx(lam[5], abs=1e-9 * np.abs(lam).max())


@pytest.mark.parametrize("name", SMOOTH)
def test_values_are_those_of_the_columns(name, monkeypatch):
    mech = mbdae.load(name)
    sol = mbdae.solve(mech, (0, 1e-3), step=5e-4)
    columns, system = sol.signals(), mech.system()
    values = {name: x for name, x in signal_values(mech).items() if not name.startswith(WORK)}  # of runs
    assert list(columns) == list(values)
    t, y = sol.t[-1], sol.y[-1]
    derivative = system.derivative(t, y)
    monkeypatch.setattr(system, "derivative", lambda t, y: derivative)  # once for all signals at this point
    monkeypatch.setattr(mbdae.Mechanism, "system", lambda self: system)  # they share the workspace
    fastest = max((abs(x[-1]) for signal, x in columns.items() if signal.startswith("a.")), default=0.0)
    for k, (signal, known) in enumerate(values.items()):
        if k % {"column": 53, "reaction": 7 if mech.nv > 12 else 1}.get(known.kind, 1):  # some of many
            continue
        x = value(system, known, t, y)
        kind = signal.partition(".")[0]
        expected = columns[signal][-1]
        force = np.abs(sol.lam[-1]).max(initial=0)
        size = 1 + {"a": fastest, **dict.fromkeys(("force", "torque", "effort", "lam"), force)}.get(kind, abs(x))
        assert x == pytest.approx(float(expected), abs=1e-9 * size, nan_ok=True), signal


def test_a_signal_missing_in_the_core_is_monitored_in_python():
    mech = shared_model("rolling_disc")
    text = next(n for n in signal_values(mech) if n.startswith("contact.") and n.endswith(".x"))
    plain = mbdae.solve(mech, (0, 0.2))
    x = plain.signals(text)[text]
    event = f"{text} = {float(x[0] + x[-1]) / 2!r}"
    sols = [mbdae.solve(mech, (0, 0.2), events=event, backend=b) for b in ("auto", "python")]
    assert len(sols[0].events[0][0]) == len(sols[1].events[0][0]) == 1
    assert sols[0].events[0][0][0] == pytest.approx(sols[1].events[0][0][0], abs=1e-9)
    if sols[0].stats["backend"] == "native":
        assert sols[0].stats["events"] == f"python: the core does not have {event!r}"


def test_accelerations_and_loads_of_joints_are_signals():
    """Accelerations in the core, joint reactions in Python, as the statistics report."""
    mech = shared_model("four_bar")
    plain = mbdae.solve(mech, (0, 0.2))
    known = {"a.crank": True, "force.crank": False, "force.rocker.z": False, "force.pin.x": False}
    for text, compiled in known.items():
        x = plain.signals(text)[text]
        event = f"{text} = {float(x[1] + x[-2]) / 2!r}"
        sols = [mbdae.solve(mech, (0, 0.2), events=event, backend=b) for b in ("auto", "python")]
        assert len(sols[0].events[0][0]) == len(sols[1].events[0][0]) > 0
        np.testing.assert_allclose(sols[0].events[0][0], sols[1].events[0][0], rtol=0, atol=1e-9)
        if sols[0].stats["backend"] == "native":
            assert sols[0].stats["events"] == ("native" if compiled else f"python: the core does not have {event!r}")


@pytest.mark.usefixtures("back_end")
def test_gaps_are_signals_of_events_and_modes_are_not():
    """The stop of the pendulum is at 0.3 rad, so its gap is q - 0.3."""
    mech = shared_model("pendulum_on_stop")
    gap, angle = (mbdae.solve(mech, (0, 1.6), events=e) for e in ("gap.rod stop < 0.1", "q.rod < 0.4"))
    assert len(gap.events[0][0]) == len(gap.impacts) == 2
    assert gap.events[0][0] == pytest.approx(angle.events[0][0], abs=1e-12)
    simulator = mbdae.Simulator(mech)
    assert np.diff(simulator.signals("gap.rod stop", "q.rod")) == pytest.approx(0.3, abs=1e-14)
    for name in ("mode.rod stop", "impulse.rod stop"):
        with pytest.raises(mbdae.errors.InputError, match="it belongs to a run"):
            mbdae.solve(mech, (0, 1.6), events=f"{name} = 1")
