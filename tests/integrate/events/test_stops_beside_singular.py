"""A parallelogram with a stop close to the position in which its bars are in line: impact and crossing.

Its motion is that of one pendulum, J q'' = 2 g cos q, integrated by scipy from impact to impact. Of 432 runs none may
end early if the stop is 1e-5 rad or more from the line, on either side; closer ones may, with a reason.

    python -m tests.integrate.events.test_stops_beside_singular      # all of them
"""

from functools import cache
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from linkages import parallelogram_model
from scipy.integrate import solve_ivp

import mbdae

G, J, END = 9.81, 2 * (0.1 + 0.25) + 1.0, 1.0  # two bars that rotate, one that does not
SIGNS, START, SPEED = np.array([1.0, -1.0, 1.0]), 1.2, -8.0
PLACES = [side * x for side in (1, -1) for x in np.logspace(-20 / 3, -1, 18)]  # before the line, and after it
CASES = list(product(range(len(PLACES)), (0.0, 0.6), ("pherk6", "radau5"), (1e-4, 1e-6, 1e-8)))
RELEVANT = 0.99e-5  # rad


def bars(gravity, place, restitution):
    """A crank and a rocker of 1 m, a coupler and a ground of 2 m; the crank has a stop at an angle."""
    model = parallelogram_model(pin.JointModelRY)
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    stop = mbdae.Stop(joint="crank", lower=place, restitution=restitution, name="stop")
    return mbdae.Mechanism(model, [mbdae.Closure.point("a", "b", name="pin")], stops=[stop])


@cache
def truth(gravity, place, restitution):
    """Return angle and speed of the crank at a time, and the times of the impact and of the bars in line."""

    def touch(_, y):
        return y[0] - place

    def line(_, y):
        return np.sin(y[0])

    touch.terminal, touch.direction = True, -1
    t, y, legs, impacts, lines = 0.0, [START, SPEED], [], [], []
    while t < END:
        leg = solve_ivp(
            lambda _, y: [y[1], 2 * gravity * np.cos(y[0]) / J], (t, END), y, "DOP853",
            rtol=1e-13, atol=1e-14, events=(touch, line), dense_output=True,
        )  # fmt: skip
        legs.append((t, leg.sol))
        t, y = float(leg.t[-1]), leg.y[:, -1]
        lines += [x for x in leg.t_events[1] if x > legs[-1][0]]
        if leg.status == 1:
            impacts.append(t)
            y = [place, -restitution * y[1]]
            if not y[1] and gravity <= 0:  # at rest
                legs.append((t, lambda _: np.array([place, 0.0])))
                break
    return lambda x: next(f for t0, f in reversed(legs) if t0 <= x)(x), impacts, lines


def check(k, restitution, **options):
    gravity, place = (G, -G, 0.0)[k % 3], PLACES[k]
    mech = bars(gravity, place, restitution)
    sol = mbdae.solve(mech, (0, END), START * SIGNS, SPEED * SIGNS, max_steps=3000, **options)
    at, impacts, lines = truth(gravity, place, restitution)
    tolerance = max(1e-7, 2 * options.get("rtol", 1e-6))
    error = [np.abs(q * SIGNS - at(t)[0]).max() for t, q in zip(sol.t, sol.q, strict=True)]
    assert max(error) < tolerance
    if not sol.success and abs(place) < RELEVANT:
        place = "'stop' closes within 1e-05 rad or characteristic lengths of a singular configuration"
        assert f"{place}, whose position is not known more precisely" in sol.message
        return False
    assert sol.success, sol.message
    np.testing.assert_allclose([x.t for x in sol.impacts], impacts, atol=tolerance)
    if abs(place) > 10 * RELEVANT and gravity:  # without, a straight motion is one step
        np.testing.assert_allclose([x.t for x in sol.singular], lines, atol=100 * tolerance)
    if not restitution and gravity < 0:  # at rest: the stop carries the weight
        assert sol.lam[-1, -1] == pytest.approx(-2 * gravity * np.cos(place), rel=1e-6)
    return True


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("k", "restitution", "method", "rtol"), CASES[3::11])
def test_a_stop_close_to_a_singular_configuration(k, restitution, method, rtol):
    check(k, restitution, method=method, rtol=rtol)


@pytest.mark.parametrize("k", [6, 14, 23, 32])
@pytest.mark.parametrize("options", [{"project": False, "rtol": 1e-6}, {"step": 0.003, "project": True}])
def test_with_other_methods_and_steps(k, options):
    check(k, 0.6, **options)


if __name__ == "__main__":
    through = [check(k, e, method=m, rtol=r) for k, e, m, r in CASES]
    print(f"{sum(through)} runs to the end, {len(through) - sum(through)} with the reason that there is")
