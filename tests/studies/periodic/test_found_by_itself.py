"""Motions whose period, section, start and symmetries the study finds, in closed form or against long runs."""

from dataclasses import replace

import numpy as np
import pytest
from impact_oscillator import E, T, Z, impact_motion, oscillator
from scipy.optimize import brentq

import mbdae
from mbdae import Driver, JointDamping, JointTorque
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Polynomial

TURN, TORQUE, DAMPING = 2 * np.pi, 3.0, 0.3


@pytest.fixture(scope="module")
def motor():
    forces = JointTorque(joint="crank", torque=TORQUE), JointDamping(joint="crank", damping=DAMPING)
    return mbdae.periodic(mbdae.load("slider_crank", forces=forces), rtol=1e-10)


@pytest.mark.slow
def test_a_slider_crank_with_a_motor(motor):
    """One degree of freedom: the work of torque and damping cancels, and mu = exp(-int d/I dt), I = 2 E_kin/w^2."""
    run, T = motor.run, motor.T
    states, system = run(run.t[0] + T * (np.arange(512) + 0.5) / 512), motor.mechanism.system()
    speed = states.v[:, 0]
    inertia = np.array([2 * system.energy(q, v)[0] for q, v in zip(states.q, states.v, strict=True)]) / speed**2
    assert motor.shifts["crank"] == pytest.approx(TURN, rel=1e-14)
    assert pytest.approx(DAMPING * T * np.mean(speed**2), rel=1e-9) == TURN * TORQUE
    assert motor.multipliers.real == pytest.approx([np.exp(-DAMPING * T * np.mean(1 / inertia))], rel=1e-7)
    assert motor.symmetry == ()


def test_the_section_that_is_found_leads_to_the_same_motion(motor):
    again = mbdae.periodic(motor.mechanism, q=motor.q, v=motor.v, section=motor.section, rtol=1e-10)
    assert pytest.approx(motor.T, rel=1e-9) == again.T
    assert again.section == motor.section
    assert again.multipliers.real == pytest.approx(motor.multipliers.real, rel=1e-6)


@pytest.mark.slow
def test_a_crank_of_constant_speed_turns_once_per_period():
    """A driven position has the driver's period; a driven speed leaves the phase free."""
    position = Driver(joint="crank", motion=Polynomial(coefficients=(0.3, 5.0)))
    speed = Driver(joint="crank", speed=5.0)
    for driver, free in ((position, False), (speed, True)):
        found = mbdae.periodic(mbdae.load("slider_crank", drivers=[driver]), v={"crank": 5.0} if free else None)
        assert pytest.approx(TURN / 5, rel=1e-10) == found.T
        assert found.shifts == pytest.approx({"crank": TURN, "crank_pin": -TURN})
        assert ("time" in [x.name for x in found.neutral]) == free
        assert ("\n  begins at t = 8 s\n" in str(replace(found, t=8.0))) == (not free)


def test_a_ratchet_advances_by_a_pitch_per_stroke():
    """The stroke of 0.4 rad passes one tooth of 24; all play ends in a stroke, so no multiplier is left."""
    found = mbdae.periodic("ratchet", rtol=1e-9)
    assert pytest.approx(2.0, rel=1e-14) == found.T
    assert found.shifts == {"wheel": pytest.approx(TURN / 24, rel=1e-14)}
    assert (found.stability, len(found.multipliers)) == ("stable", 0)
    run = found.run
    assert run.q[-1, 0] - run.q[0, 0] == pytest.approx(TURN / 24, abs=1e-10)


@pytest.mark.slow
def test_a_disc_in_a_circle_has_all_of_its_symmetries():
    found = mbdae.periodic("rolling_disc")
    assert set(found.symmetry) == {"disc", "x", "y", "turn"}
    assert [x.name for x in found.neutral] == ["time", *found.symmetry, "energy"]
    assert max(x.error for x in found.neutral) < 1e-9


@pytest.mark.slow
def test_a_run_that_does_not_come_back_asks_for_a_period():
    """A double pendulum; and the joint of a pendulum is not a symmetry."""
    assert mbdae.periodic("pendulum", 2.1).symmetry == ()
    with pytest.raises(InputError, match="does not return to its final state: give an estimate of the period"):
        mbdae.periodic("double_pendulum")


def test_a_section_that_is_crossed_in_a_jump_is_one_line():
    with pytest.raises(InputError, match=r"^the section 'q.stance > 0' is crossed in a jump.* by 'heel strike': take"):
        mbdae.periodic("compass_gait", section="q.stance > 0", rtol=1e-8)


@pytest.mark.slow
def test_a_run_of_twice_the_period_of_the_force():
    """Beyond the period doubling of the impact oscillator impacts alternate; det = (e^2 exp(-2 z T))^2."""
    d = E**2 * np.exp(-2 * Z * T)
    doubling = brentq(lambda u: np.trace(impact_motion(u).monodromy) + 1 + d, 0.3, 1.0, xtol=1e-13)
    exact = impact_motion(doubling - 0.05)
    (x, v), mech = exact.start, oscillator(exact.force, exact.phase + np.pi)
    found = mbdae.periodic(mbdae.solve(mech, (0, 60 * T), [x + 1e-2], [v], rtol=1e-9), rtol=1e-10)
    assert pytest.approx(2 * T, rel=1e-13) == found.T
    first, second = (impact.impulse[0] for impact in found.run.impacts)
    assert abs(first - second) > 0.05
    assert found.stability == "stable"
    assert np.prod(found.multipliers).real == pytest.approx(d**2, rel=1e-8)
