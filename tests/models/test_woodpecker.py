"""The woodpecker toy against its published limit cycle, and with the nonlinear geometry."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty, frame

import mbdae
from mbdae import Closure, CoulombFriction, JointSpring, Mechanism

R0, RM, HM, LM, LG, HS, LS = 2.5e-3, 3.1e-3, 5.8e-3, 10e-3, 15e-3, 20e-3, 20.1e-3
SLEEVE, BIRD, J_SLEEVE, J_BIRD, C, MU = 3e-4, 4.5e-3, 5e-9, 7e-7, 5.6e-3, 0.3
SPECK, BALL = 1e-9, 1e-4  # masses in kg of carrier bodies, radius of the balls in m


def linear_toy():
    """The published model: small angles. Points move along lines defined by couplings, the pole is at x = 0."""
    model = empty()
    sleeve = add_body(model, 0, pin.JointModelRY(), "sleeve", 0.0, inertia=(0, J_SLEEVE, 0))
    add_body(model, sleeve, pin.JointModelRY(), "bird", 0.0, inertia=(0, J_BIRD, 0))
    y = add_body(model, 0, pin.JointModelPZ(), "y", SLEEVE)
    add_body(model, y, pin.JointModelPZ(), "mass", BIRD)
    turned = pin.SE3(pin.utils.rotate("y", np.pi / 2), np.zeros(3))
    model.addFrame(pin.Frame("pole", 0, 0, turned, pin.FrameType.OP_FRAME))
    couplings = [Closure.coupling("mass", ("sleeve", "bird"), (0, LM + LG, LG))]
    contacts, forces = [], [JointSpring(joint="bird", stiffness=C)]
    ways = {"beak": ((-HS, -HS), (LM + LG - LS, LG - LS), LM + LG - LS - R0, 0.5)}
    ways |= {"lower": ((HM, 0), (RM, 0), RM - R0, 0.0), "upper": ((-HM, 0), (RM, 0), RM - R0, 0.0)}
    for name, (across, up, gap, e) in ways.items():
        j = add_body(model, y, pin.JointModelPX(), f"{name} x", SPECK)
        j = add_body(model, j, pin.JointModelPZ(), f"{name} z", SPECK)
        frame(model, j, name, BALL + gap, 0, 0)
        for k, shares in ((f"{name} x", across), (f"{name} z", up)):
            couplings.append(Closure.coupling(k, ("sleeve", "bird"), (0, *shares)))
        how = {"grip": "longitudinal", "unilateral": True, "restitution": e}
        contacts.append(Closure.rolling("pole", name, BALL, name=f"{name} contact", **how))
        forces.append(CoulombFriction(closure=f"{name} contact", coefficient=MU, exact=True))
    return Mechanism(model, [*couplings, *contacts], forces)


def test_the_published_state_comes_again_after_a_cycle():
    """It lies on the limit cycle: y' -0.3411, sleeve -0.1034 (at its limit), bird -0.2788, bird' -7.4583.

    Moreau's time stepping of the same three equations, with steps of 2e-5 s, has 0.1460 s and 19.47 mm per cycle.
    """
    mech, sleeve, bird, down, spin = linear_toy(), -0.1034, -0.2788, -0.3411, -7.4583
    at = [mech.model.joints[mech.model.getJointId(name)].idx_v for name in ("y", "sleeve", "bird")]
    q = {"y": 0.0, "sleeve": sleeve, "bird": bird - sleeve}
    begin = mech.assemble(q=q, v={"y": down, "sleeve": 0.0, "bird": spin})
    sol = mbdae.solve(mech, (0, 0.15), *begin, rtol=1e-6, events=f"q.bird < {bird - sleeve}")
    assert sol.success
    where = [x.where for x in sol.impacts]
    assert where == [(f"{name} contact",) for name in ("lower", "upper", "beak", "upper", "lower", "lower")]
    times, points = sol.events[0]
    cycle, q, v = times[-1], points[-1][: mech.nq], points[-1][mech.nq : mech.nq + mech.nv]
    assert cycle == pytest.approx(0.1460, rel=2e-3)
    assert q[at[0]] == pytest.approx(-19.47e-3, rel=1e-2)
    assert v[at] == pytest.approx([down, 0, spin], rel=1e-2, abs=1e-8)
    jammed = next(i for i, (_, mode) in enumerate(sol.modes) if mode == (0, 1, 0))
    assert sol.t[[sol.modes[jammed][0], sol.modes[jammed + 1][0]]] == pytest.approx([0.0216, 0.0612], abs=1e-4)
    assert mbdae.drift(sol).energy_relative < 1e-6


def test_the_model_jams_slips_and_pecks():
    """Both edges of the hole are rounded, and angles are not small: the cycle is shorter by a tenth."""
    mech = mbdae.load("woodpecker")
    sol = mbdae.solve(mech, (0, 0.17), rtol=1e-6)
    lower = [mode[1] for _, mode in sol.modes]
    words = [mech.switches[1].states[k] for k, before in zip(lower, [None, *lower], strict=False) if k != before]
    assert words == ["open", "sliding", "sticking", "sliding", "open", "sliding", "sticking"]
    assert [x.where for x in sol.impacts] == [("lower edge",), ("beak",), ("lower edge",), ("lower edge",)]
    begins = [sol.t[node] for node, mode in sol.modes if mode[1] == 1]
    assert begins[1] - begins[0] == pytest.approx(0.1295, abs=2e-4)
    grips = sol.t[[node for node, _ in sol.modes]].searchsorted(begins)
    held = slice(sol.modes[grips[0]][0], sol.modes[grips[0] + 1][0])
    assert np.abs(sol.v[held, :2]).max() < 1e-13  # m/s, of speeds of 0.1 to 10: rounding
    assert np.ptp(sol.q[held, 0]) < 1e-14
    assert mbdae.drift(sol).energy_relative < 1e-7
