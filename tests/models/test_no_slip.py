"""Models with rolling, knife edges and gears, against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbdae

TIGHT = {"method": "pherk6", "rtol": 1e-11}


def run(name, end, q=None, v=None, **parameters):
    """A model's motion, by name of the coordinates."""
    mech = mbdae.load(name, **parameters)
    sol = mbdae.solve(mech, (0, end), *((q, v) if q is not None else ()), **TIGHT)
    assert sol.status == "finished", sol.message
    return sol


def columns(sol, *names):
    values = sol.signals()
    return [values[name] for name in names]


def test_chaplygin_sleigh():
    """u = V tanh s, w = V/k sech s, s' = a V/k^2, heading k/a times the Gudermannian of s."""
    m, inertia, a, V = 2.0, 0.3, 0.4, 1.5
    k = np.sqrt(inertia / m + a * a)
    sol = run("chaplygin_sleigh", 3.1)
    s = -3 + a * V / k**2 * sol.t
    assert sol.v[:, 0] == pytest.approx(V * np.tanh(s), abs=2e-10)
    assert sol.v[:, 2] == pytest.approx(V / k / np.cosh(s), abs=2e-10)
    assert sol.q[-1, 0] == pytest.approx(-2.889075124839, abs=2e-10)
    turn = np.arctan2(sol.q[-1, 3], sol.q[-1, 2])
    assert turn % (2 * np.pi) == pytest.approx(4.09593793867471, abs=2e-10)
    force = m * sol.v[:, 0] * sol.v[:, 2] * inertia / (inertia + m * a * a)
    assert np.abs(sol.lam[:, 0]) == pytest.approx(np.abs(force), abs=2e-10)


@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_ball_on_a_turntable(tilt):
    """v' = 2/7 W z x v + 5/7 g sin b x: circles at 2/7 of the table's speed, which drift across the incline."""
    W, turns = 3.0, 10 if not tilt else 1
    sol = run("ball_on_turntable", turns * 7 * np.pi / W, tilt=tilt)
    at = sol.q[:, 2:4] @ [1, 1j]
    spin, drift = 2j / 7 * W, 5 * 9.81 * np.sin(tilt) / (2 * W)
    v0, mean = 0.5j, -1j * drift  # v' = spin v + 5/7 g sin b has the mean velocity -5/7 g sin b/spin
    mean = 5 / 7 * 9.81 * np.sin(tilt) / -spin
    exact = 0.6 + (v0 - mean) * (np.exp(spin * sol.t) - 1) / spin + mean * sol.t
    assert abs(mean) == pytest.approx(drift)
    assert np.abs(at - exact).max() < (1e-11 if not tilt else 3e-9)


@pytest.mark.parametrize("follower", ["roller", "flat", "law"])
def test_cam_follower(follower):
    """Lift e sin p + sqrt((R + r)^2 - e^2 cos^2 p), or R + e sin p with the force m (g - e w^2 sin p)."""
    sol = run("cam_follower", 1.0, follower=follower)
    e, R, r, w, m = 0.01, 0.04, 0.01, 20.0, 0.2
    p, lift = w * sol.t, sol.q[:, 2]
    if follower == "roller":
        assert lift == pytest.approx(e * np.sin(p) + np.sqrt((R + r) ** 2 - (e * np.cos(p)) ** 2), abs=8e-14)
        return
    assert lift == pytest.approx(R + e * np.sin(p), abs=4e-14)
    assert sol.lam[:, 0] == pytest.approx(m * (9.81 - e * w**2 * np.sin(p)), abs=5e-13)


def test_planetary_gear():
    """Willis: w_c (r_s + r_r) = w_s r_s with the ring at rest; one equation of motion for the sun."""
    sol = run("planetary_gear", 3.0)
    sun, carrier, planet = columns(sol, "v.sun", "v.carrier", "v.planet_2")
    assert carrier == pytest.approx(0.3 * sun, rel=1e-13)
    assert planet == pytest.approx(-carrier * 3.5, rel=1e-13)
    moving = 0.5 * 0.03**2 / 2 + 0.3**2 * (0.4 * 0.05**2 / 2 + 3 * 0.2 * 0.05**2)
    moving += 3 * 0.2 * 0.02**2 / 2 * (0.3 * 2.5) ** 2
    plain = solve_ivp(
        lambda t, w: (0.02 * np.sin(3 * t) - 1e-3 * 0.09 * w) / moving, (0, 3), [10.0], rtol=1e-12, atol=1e-12
    )
    assert sun[-1] == pytest.approx(plain.y[0, -1], abs=1e-8)


def test_differential_drive():
    """The middle of the axle runs on a circle of radius d/2 (w_r + w_l)/(w_r - w_l)."""
    sol = run("differential_drive", 5.0, left=6.0, right=9.0)
    x, y, c, s = sol.q[:, :4].T
    assert np.hypot(x, y - 1.0) == pytest.approx(1.0, abs=2e-13)
    assert np.array([c, s]) == pytest.approx(np.array([np.cos(0.75 * sol.t), np.sin(0.75 * sol.t)]), abs=2e-13)


def test_trailer_behind_a_straight_hitch():
    """tan(phi/2) = tan(phi_0/2) exp(-s/L)."""
    sol = run("differential_drive", 4.0, left=10.0, right=10.0, angle=2.0)
    (angle,) = columns(sol, "q.trailer")
    assert angle == pytest.approx(2 * np.arctan(np.tan(1.0) * np.exp(-sol.t / 1.5)), abs=2e-12)
    assert angle[-1] == pytest.approx(0.215589202346478, abs=2e-12)


def test_mecanum_platform():
    """A constant velocity (v_x, v_y, w) in the platform's axes: p = (e^(i w t) - 1)/(i w) (v_x + i v_y)."""
    sol = run("mecanum_platform", 5.0)
    at = sol.q[:, :2] @ [1, 1j]
    assert np.abs(at - (np.exp(0.4j * sol.t) - 1) / 0.4j * (0.3 + 0.2j)).max() < 2e-13


def test_snakeboard():
    """With phi = -phi_rear the board moves along (l cos phi, sin phi) x, with a momentum driven by rotor and phi."""
    m, J, Jr, Jw, mass_l = 6.0, 0.06, 0.16, 1e-3, 0.2
    sol = run("snakeboard", 6.0)
    total = J + Jr + 2 * Jw

    def rotor(t):
        return 0.8 * 3 * np.cos(3 * t)

    def front(t):
        return 0.6 * np.sin(3 * t), 1.8 * np.cos(3 * t)

    def rates(t, y):
        (phi, rate), (p, heading) = front(t), y[[0, 1]]
        d = np.array([mass_l * np.cos(phi), np.sin(phi)])
        xi = (p - d[1] * Jr * rotor(t)) / (m * d[0] ** 2 + total * d[1] ** 2)
        u, w = d * xi
        turned = np.array([-mass_l * np.sin(phi), np.cos(phi)]) * rate
        return [turned @ [m * u, total * w + Jr * rotor(t)], w, u * np.cos(heading), u * np.sin(heading)]

    phi = front(0.0)[0]
    u, w = sol.v[0, 0], sol.v[0, 2]
    p0 = mass_l * np.cos(phi) * m * u + np.sin(phi) * (total * w + Jr * rotor(0.0))
    plain = solve_ivp(rates, (0, 6), [p0, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert sol.q[-1, :2] == pytest.approx(plain[2:], abs=1e-9)
    assert np.hypot(*plain[2:]) > 0.5


def test_rattleback_turns_back():
    """Against its preferred sense it rattles and reverses; the other way it keeps turning. Energy is conserved."""
    sol = run("rattleback", 6.0)
    assert mbdae.drift(sol).energy_relative < 1e-9
    assert sol.v[0, 5] > 4.9
    assert sol.v[-1, 5] < -1.5
    q, v = sol.mechanism.start
    other = run("rattleback", 6.0, q, -v)
    assert other.v[:, 5].max() < -4.9
