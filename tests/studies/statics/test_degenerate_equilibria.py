"""Equilibria with neutral directions, and those close to a singular configuration, where closures nearly lose rank."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty

import mbdae
from mbdae import Actuator, Closure, JointDamping, JointPID, JointSpring, Mechanism
from mbdae.errors import InputError
from mbdae.studies.statics.stability import Verdict

STIFFNESS, INERTIA = 2e4, 2 / 3 + 1  # N m/rad; kg m^2 of two cranks and a coupler that does not rotate


def sliders(n, damping=0.0):
    """A pendulum held by a controller, and n carts on level rails."""
    model, names = empty(), [f"cart_{k}" for k in range(n)]
    add_body(model, 0, pin.JointModelRY(), "arm", 1.0, (0, 0, -0.5), (0.1, 0.1, 0.1))
    for k, name in enumerate(names):
        add_body(model, 0, pin.JointModelPX(), name, 1.0 + k)
    damped = [JointDamping(joint=tuple(names), damping=damping)] if damping and n else []
    return Mechanism(model, [], [JointPID(joint="arm", kp=1.0, ki=1.0, kd=0.5, reference=0.0), *damped])


@pytest.mark.parametrize(("n", "damping"), [(n, d) for n in range(4) for d in (0.0, 0.7)])
def test_each_neutral_direction_counts_once(n, damping):
    """Without damping each has two eigenvalues 0, of a double root: a shift and a drift along it; with damping one."""
    found = mbdae.equilibrium(sliders(n, damping)).verdict
    assert found.by == "eigenvalues"
    assert (found.stability, found.neutral, found.unstable) == ("neutral" if n else "stable", n, 0)


def test_free_motions_of_a_rolling_ball_in_words():
    """Without slip there may be more free displacements than degrees of freedom; quaternions have no unit."""
    model = empty()
    add_body(model, 0, pin.JointModelFreeFlyer(), "ball", 1.0, (0, 0, 0), (0.1, 0.1, 0.1))
    mech = Mechanism(model, [Closure.rolling("world", "ball", 0.3)], title="Ball")
    text = str(mbdae.equilibrium(mech, {"ball": [0, 0, 0.3, 0, 0, 0, 1]}))
    assert text.startswith("equilibrium of Ball: neutral, 3 free motions, none growing, 3 degrees of freedom\n")
    assert "q.ball.z = 0.3 m\n" in text
    assert "q.ball.qw = 1\n" in text
    eight = Verdict("neutral", 0, 8, np.zeros(6), "eigenvalues")
    assert str(eight) == "neutral, 8 free motions, none growing, 6 degrees of freedom"


def sprung(angle):
    """A parallelogram without gravity, whose crank a spring holds at an angle; at 0 its bars are in line."""
    mech = mbdae.load("n_four_bar", N=1)
    model = mech.model.copy()
    model.gravity.linear = np.zeros(3)
    spring = JointSpring(joint="crank_0", stiffness=STIFFNESS, rest=angle)
    return Mechanism(model, mech.closures, [spring]), np.array([angle, -angle, angle])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-8, 1e-7])
def test_close_to_a_singular_configuration_there_is_no_verdict(angle):
    """The cranks can rotate against each other there, for a perturbation of a ten-millionth of a radian."""
    found = mbdae.equilibrium(*sprung(angle))
    assert found.stability == "singular"
    np.testing.assert_allclose(found.q, [angle, -angle, angle], atol=1e-9)
    with pytest.raises(InputError, match="lose rank in this pose"):
        mbdae.modes(*sprung(angle))


def test_where_the_only_row_vanishes_there_is_no_verdict():
    """Two hanging links, and a bar as long as both from a cart to their end, in line: no motion stretches it."""
    model = empty()
    upper = add_body(model, 0, pin.JointModelRY(), "upper", 1.0, (0, 0, 0), (0.1, 0.1, 0.1))
    down = pin.SE3(np.eye(3), np.array([0, 0, -1.0]))
    lower = add_body(model, upper, pin.JointModelRY(), "lower", 1.0, (0, 0, -1), (0.1, 0.1, 0.1), down)
    model.addBodyFrame("end", lower, down, 0)
    add_body(model, 0, pin.JointModelPX(), "cart")
    spring = JointSpring(joint="cart", stiffness=STIFFNESS)
    mech = Mechanism(model, [Closure.distance("cart", "end", 2.0)], [spring], title="Chain")
    assert mbdae.equilibrium(mech, np.zeros(3)).stability == "singular"
    with pytest.raises(InputError, match="lose rank in this pose"):
        mbdae.modes(mech, np.array([0.0, 0.0, 1e-12]))  # rounding


@pytest.mark.parametrize("angle", [1e-4, 1e-2, 0.5])
def test_further_away_there_is(angle):
    found = mbdae.equilibrium(*sprung(angle))
    assert found.stability == "stable"
    assert found.verdict.squares == pytest.approx([STIFFNESS / INERTIA], rel=1e-6)
    frequency = mbdae.modes(*sprung(angle)).eigenvalues.imag.max()
    assert frequency == pytest.approx(np.sqrt(STIFFNESS / INERTIA), rel=1e-6)


@pytest.mark.parametrize("n", [0, 2])
def test_a_state_that_acts_on_nothing_is_no_neutral_direction(n):
    """An angle summed up from speeds: any value is an equilibrium, without a displacement of the mechanism."""
    mech = sliders(n)
    counter = Actuator(lambda t, q, v, s: 0 * v, lambda t, q, v, s: v[:1], {"angle": 0.0}, "counter")
    found = mbdae.equilibrium(Mechanism(mech.model, [], [*mech.forces, counter])).verdict
    assert found.by == "eigenvalues"
    assert (found.stability, found.neutral, found.unstable) == ("neutral" if n else "stable", n, 0)
