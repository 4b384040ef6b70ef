"""The benchmark bicycle against published numbers: 44 eigenvalues, nine accelerations, two motions.

Meijaard, Papadopoulos, Ruina, Schwab, Proc. R. Soc. A 463 (2007) 1955, table 2; Basu-Mandal, Chatterjee, Papadopoulos,
Proc. R. Soc. A 463 (2007) 1983, table 1.
"""

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import null_space
from scipy.optimize import brentq, fsolve

import mbdae
from mbdae.mechanism.closures.contact import ConvexBody
from mbdae.mechanism.formulations.equation_partials import equation_partials, gamma_partials
from mbdae.mechanism.tree.frames import motion_cross

WEAVE = {  # m/s: real and imaginary part
    1: (3.52696170990070, 0.80774027519930), 2: (2.68234517512745, 1.68066296590675),
    3: (1.70675605663975, 2.31582447384325), 4: (0.41325331521125, 3.07910818603206),
    5: (-0.77534188219585, 4.46486771378823), 6: (-1.52644486584142, 5.87673060598709),
    7: (-2.13875644258362, 7.19525913329805), 8: (-2.69348683581097, 8.46037971396931),
    9: (-3.21675402252485, 9.69377351531791), 10: (-3.72016840437287, 10.90681139476287),
}  # fmt: skip
REAL = {  # capsize and castering
    1: (-3.13423125066578, -7.11008014637442), 2: (-3.07158645641514, -8.67387984831735),
    3: (-2.63366137253667, -10.35101467245920), 4: (-1.42944427361326, -12.15861426576447),
    5: (-0.32286642900409, -14.07838969279822), 6: (-0.00406690076970, -16.08537123098026),
    7: (0.10268170574766, -18.15788466125262), 8: (0.14327879765713, -20.27940894394569),
    9: (0.15790184030917, -22.43788559040858), 10: (0.16105338653172, -24.62459635017404),
}  # fmt: skip
AT_REST = (3.13164324790656, 5.53094371765393)


def roots(speed, mech=None):
    """Eigenvalues of the straight motion, (5,), without position, heading and wheel angles; one is 0."""
    mech = mech or mbdae.load("bicycle", speed=speed)
    (q, v), s, nv = mech.start, mech.system(), mech.nv
    F, lam = s.derivative(0.0, mech.point())
    assert np.abs(F[nv:]).max() < 1e-11
    at = equation_partials(s, 0.0, q, np.append(v, 0.0), np.zeros(nv), lam, np.arange(mech.ng))
    M, K, D, G, B = at.E[:nv, :nv], at.K[:nv], at.D[:nv, :nv], at.G, at.B
    gamma_q, gamma_v = gamma_partials(s, q, v)
    saddle = np.block([[M, -G.T], [G, np.zeros((mech.ng, mech.ng))]])
    dvdot = np.linalg.solve(saddle, np.block([[K, D], [-gamma_q, -gamma_v]]))[:nv]
    transport = np.zeros((nv, nv))
    transport[:6, :6] = -motion_cross(np.repeat(v[:6, None], 6, axis=1), np.eye(6))
    A = np.block([[transport, np.eye(nv)], [dvdot[:, :nv], dvdot[:, nv:]]])
    kept = null_space(np.block([[G[mech.positional], np.zeros((mech.positional.sum(), nv))], [B, G]]))
    alike = np.zeros((2 * nv, 5))
    alike[[0, 1, 5, 6, 8], range(5)] = 1.0
    inside = kept.T @ alike
    assert np.abs(kept @ inside - alike).max() < 1e-12
    rest = null_space(inside.T)
    return np.linalg.eigvals(rest.T @ (kept.T @ A @ kept) @ rest)


def published(speed):
    if not speed:
        return np.array([x for root in AT_REST for x in (root, -root)] + [0.0])
    re, im = WEAVE[speed]
    return np.array([complex(re, im), complex(re, -im), *REAL[speed], 0.0])


def farthest(found, expected):
    """The largest distance between two sets of values."""
    return max(max(np.abs(found - x).min() for x in expected), max(np.abs(expected - x).min() for x in found))


@pytest.mark.parametrize("speed", range(11))
def test_published_eigenvalues(speed):
    assert farthest(roots(float(speed)), published(speed)) < 1e-12


def test_weave_and_capsize_speeds():
    def weave(speed):
        return max(x.real for x in roots(speed) if abs(x.imag) > 1)

    def capsize(speed):
        return np.poly(roots(speed))[-2].real  # the product of all roots except the one that is 0

    assert brentq(weave, 4.2, 4.4, xtol=1e-13) == pytest.approx(4.29238253634111, abs=1e-12)
    assert brentq(capsize, 6.0, 6.1, xtol=1e-13) == pytest.approx(6.02426201538837, abs=1e-11)


# -- Basu-Mandal, Chatterjee, Papadopoulos: 3-1-3 angles theta, psi, phi of the frame; their x points back -----------

Z, PSI, PHI, STEER = 0.2440472102925, 0.9501292851472, 3.1257073014894, 0.2311385135743
RATES = [
    -2.8069345714545, -0.1480982396001, 0.1058778746261, 0.7830033527065, 0.6068425835418, -0.0119185528069,
    0.4859824687093, 8.9129896614890, 8.0133620584155,
]  # fmt: skip
ACCELERATIONS = [
    -0.5041626315047, -0.3449706619454, -1.4604528332980, 0.8353281706379, -7.8555281128244, 0.1205543897884,
    -4.6198904039403, 1.8472554144217, 2.4548072904550,
]  # fmt: skip
FIRST, SECOND = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])  # axes of theta and psi at theta = 0


def turn(axis, angle):
    return pin.exp3(angle * np.eye(3)[axis])


def state(mech):
    """q and v, and the inverse maps: the frame's axes, those of the three angles and their rates."""
    third = turn(0, PSI) @ FIRST
    axes = np.column_stack([FIRST, SECOND, third])
    moving = [0 * FIRST, RATES[3] * np.cross(FIRST, SECOND), np.cross(RATES[3] * FIRST + RATES[4] * SECOND, third)]
    theirs = turn(0, PSI) @ turn(2, PHI)
    R = np.column_stack([theirs[:, 0], theirs[:, 2], -theirs[:, 1]])  # ahead, left, up
    q, _ = mech.coordinates({"frame": [0, 0, Z, *pin.Quaternion(R).coeffs()], "fork": STEER})
    v = np.concatenate([R.T @ RATES[:3], R.T @ axes @ RATES[3:6], [RATES[7], RATES[6], RATES[8]]])
    return q, v, R, axes, np.column_stack(moving)


def accelerations(mech):
    q, v, R, axes, moving = state(mech)
    F, _ = mech.system().derivative(0.0, np.concatenate([q, v, [0.0]]))
    vdot = F[mech.nv : 2 * mech.nv]
    place = R @ (vdot[:3] + np.cross(v[3:6], v[:3]))
    angles = np.linalg.solve(axes, R @ vdot[3:6] - moving @ RATES[3:6])
    return np.array([*place, *angles, vdot[7], vdot[6], vdot[8]])


def test_published_accelerations():
    mech = mbdae.load("bicycle")
    g, Gv = mech.residual(*state(mech)[:2])
    assert np.abs(g).max() < 1e-12
    assert np.abs(Gv).max() < 1e-12
    np.testing.assert_allclose(accelerations(mech), ACCELERATIONS, rtol=0, atol=5e-12)


@pytest.mark.parametrize("wrong", [lambda t: t._replace(dp=0 * t.dp), lambda t: t._replace(p=t.p + 0.003 * t.n)])
def test_accelerations_depend_on_the_contact_point_of_the_wheel(monkeypatch, wrong):
    original = ConvexBody.contact_kinematics
    monkeypatch.setattr(ConvexBody, "contact_kinematics", lambda shape, pair: wrong(original(shape, pair)))
    assert np.abs(accelerations(mbdae.load("bicycle")) - ACCELERATIONS).max() > 1e-3


def test_a_disturbed_motion():
    """After 5 s, from two methods with another program: speed, steer, roll, position of the hub."""
    mech = mbdae.load("bicycle", speed=4.6)
    q, v = mech.start
    v = v.copy()
    v[[1, 3]] = -0.5 * q[2], 0.5  # roll about the line of contacts
    q, v = mech.assemble(q, v)
    sol = mbdae.solve(mech, (0, 5), q, v, rtol=1e-11)
    end, R = sol.q[-1], pin.Quaternion(sol.q[-1, 3:7]).matrix()
    np.testing.assert_allclose(end[:2], [22.5838866544, -4.8312129738], atol=1e-8)
    assert end[9] == pytest.approx(-0.00818567097, abs=1e-9)
    assert np.arcsin(R[2, 1]) == pytest.approx(0.01034244064, abs=1e-9)
    assert 0.3 * sol.v[-1, 6] == pytest.approx(4.62253556041, abs=1e-5)
    assert sol.success


def test_a_circle_without_hands():
    """Leaned by 0.2 to the right; the rotation of the steered wheel and the yaw rate determine the speed."""
    mech = mbdae.load("bicycle")
    steer, yaw = -0.0601573845698, -0.338549938489

    def leaned(x):
        R = turn(0, 0.2) @ turn(1, x[1])
        return mech.coordinates({"frame": [0, 0, x[0], *pin.Quaternion(R).coeffs()], "fork": steer})[0]

    q = leaned(fsolve(lambda x: mech.residual(leaned(x), np.zeros(9))[0][mech.positional], [0.29, 0.0]))
    G, v, free = mech.system().closures(q)[1], np.zeros(9), [0, 1, 2, 6, 8]
    v[3:6] = pin.Quaternion(q[3:7]).matrix().T @ [0, 0, yaw]
    v[free] = np.linalg.lstsq(G[:, free], -G @ v)[0]
    assert 0.3 * v[6] == pytest.approx(5.9083242853, abs=1e-9)
    sol = mbdae.solve(mech, (0, 5), *mech.assemble(q, v), rtol=1e-11)
    np.testing.assert_allclose(sol.q[:, 9], steer, atol=1e-11)
    np.testing.assert_allclose([pin.Quaternion(x).matrix()[2, 1] for x in sol.q[:, 3:7]], np.sin(0.2), atol=1e-11)
