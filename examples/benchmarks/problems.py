"""The three problems of work_precision.py, with their references.

Those of the four-bar and of the double pendulum are computed by DOP853 of scipy at rtol 1e-13 from equations in
independent angles, apart from mbdae and Pinocchio (planar.py); that of Andrews' mechanism is published.

Four-bar: bars of 1, 2 and 1.5 m and 1 kg/m on a ground of 2 m. Double pendulum: bars of 1 and 0.8 m, 1 and 0.8 kg, 0.9
and 0.4 rad from hanging. Both from rest, for 10 s. Andrews' squeezing mechanism for 0.03 s.
"""

from functools import cache

import numpy as np
import pinocchio as pin
from planar import Array, Bar, Equations, Problem
from scipy.integrate import solve_ivp

import mbdae


def rod(name: str, parent: str | None, hinge: complex, length: float, mass: float, start: float) -> Bar:
    """Return a uniform thin bar."""
    return Bar(name, parent, hinge, length / 2, mass, mass * length**2 / 12, start)


@cache
def four_bar_end() -> Array:
    """Integrate in the crank's angle: other angles by the intersection of two circles, rates by G v = 0."""
    eq = Equations(FOUR_BAR)

    def pose(crank: float) -> Array:
        tip = np.exp(1j * crank)
        across = 2 - tip
        d = abs(across)
        x = (2.0**2 - 1.5**2 + d * d) / (2 * d)
        corner = tip + across / d * complex(x, np.sqrt(2.0**2 - x * x))
        return np.array([crank, np.angle(corner - tip), np.angle(corner - 2)])

    def rate(t: float, y: Array) -> list[float]:
        q = pose(y[0])
        J = eq.B[0] * eq.e(q[:, None])[1][:, 0]
        G = np.vstack([J.real, J.imag])
        v = y[1] * np.concatenate([[1.0], np.linalg.solve(G[:, 1:], -G[:, 0])])
        return [y[1], eq.acceleration(q, v)[0][0]]

    y = solve_ivp(rate, (0, FOUR_BAR.end), [FOUR_BAR.bars[0].start, 0], method="DOP853", rtol=1e-13, atol=1e-13).y
    return FOUR_BAR.relative(pose(y[0, -1]))


@cache
def pendulum_end() -> Array:
    """Lagrange's equations in the two angles."""
    eq, n = Equations(DOUBLE_PENDULUM), 2
    y0 = np.concatenate([DOUBLE_PENDULUM.absolute(DOUBLE_PENDULUM.start()), np.zeros(n)])
    sol = solve_ivp(
        lambda t, y: np.concatenate([y[n:], eq.acceleration(y[:n], y[n:])[0]]),
        (0, DOUBLE_PENDULUM.end), y0, method="DOP853", rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    return DOUBLE_PENDULUM.relative(sol.y[:n, -1])


def pendulum_model(cut: bool = False) -> mbdae.Mechanism:
    """Return the double pendulum in the x-z plane: a tree, or with the lower bar on rails and a pin that carries it."""
    upper, lower = DOUBLE_PENDULUM.bars
    model = pin.Model()
    turn = pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))
    at = [pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])) for x in (0.0, upper.com.real, 1.0, lower.com.real)]
    joint = model.addJoint(0, turn, at[0], upper.name)
    model.appendBodyToJoint(
        joint, pin.Inertia(upper.mass, np.zeros(3), np.diag([0, upper.inertia, upper.inertia])), at[1]
    )
    model.addFrame(pin.Frame("elbow", joint, at[2], pin.FrameType.OP_FRAME))
    parent, place = joint, at[2]
    if cut:
        x = model.addJoint(0, pin.JointModelPX(), at[0], "x")
        parent, place = model.addJoint(x, pin.JointModelPZ(), at[0], "z"), at[0]
    joint = model.addJoint(parent, turn, place, lower.name)
    model.appendBodyToJoint(
        joint, pin.Inertia(lower.mass, np.zeros(3), np.diag([0, lower.inertia, lower.inertia])), at[3]
    )
    model.addFrame(pin.Frame("top", joint, at[0], pin.FrameType.OP_FRAME))
    return mbdae.Mechanism(model, closures=[mbdae.Closure.point("elbow", "top", name="elbow")] if cut else [])


ELBOW_UP = (-0.9265861105397016, 1.3775510639714883)
FOUR_BAR = Problem(
    "four-bar",
    10.0,
    lambda: mbdae.load("four_bar"),
    (
        rod("crank", None, 0j, 1.0, 1.0, 1.2),
        rod("coupler", "crank", 1 + 0j, 2.0, 2.0, ELBOW_UP[0]),
        rod("rocker", None, 2 + 0j, 1.5, 1.5, ELBOW_UP[1]),
    ),
    four_bar_end,
    pins=(("coupler", 2 + 0j, "rocker", 1.5 + 0j),),
)
DOUBLE_PENDULUM = Problem(
    "double pendulum",
    10.0,
    pendulum_model,
    (rod("upper", None, 0j, 1.0, 1.0, 0.9 - np.pi / 2), rod("lower", "upper", 1 + 0j, 0.8, 0.8, 0.4 - 0.9)),
    pendulum_end,
)
ANDREWS = Problem(
    "Andrews",
    0.03,
    lambda: mbdae.load("andrews_squeezer"),
    (
        Bar("beta", None, 0j, 0.00092 + 0j, 0.04325, 2.194e-6, -0.0617138900142764496358948458001),
        Bar("Theta", "beta", 0.007 + 0j, -0.0115 + 0j, 0.00365, 4.41e-7, 0.0),
        Bar(
            "gamma", None, -0.03635 + 0.03273j, 0.01043 - 0.01874j, 0.02373, 5.255e-6, 0.455279819163070380255912382449
        ),
        Bar("delta", None, -0.06934 - 0.00227j, 0.02308 + 0.00916j, 0.0705, 1.169e-5, 0.487364979543842550225598953530),
        Bar("Phi", "delta", 0.04 + 0j, -0.00579j, 0.00706, 5.667e-7, 0.222668390165885884674473185609),
        Bar(
            "epsilon",
            None,
            -0.06934 - 0.00227j,
            -0.00449 - 0.01228j,
            0.05498,
            1.912e-5,
            1.23054744454982119249735015568,
        ),
        Bar("Omega", "epsilon", -0.04j, 0.00579 + 0j, 0.00706, 5.667e-7, -0.222668390165885884674473185609),
    ),
    # of two codes in quadruple precision, agreeing to 1.2e-13
    lambda: np.array(
        [
            15.8107711951537072507,
            -15.7563710584118396601,
            0.0408222401196458005,
            0.5244099658799540702,
            -0.5347301163420796029,
            1.0480807410419378694,
            0.5347301163420796034,
        ]
    ),
    pins=(
        ("Theta", -0.028 + 0j, "gamma", -0.035j),
        ("Theta", -0.028 + 0j, "Phi", -0.02j),
        ("Theta", -0.028 + 0j, "Omega", 0.02 + 0j),
    ),
    gravity=0.0,
    torque=0.033,
    spring=("gamma", 0.02 - 0.018j, 0.014 + 0.072j, 4530.0, 0.07785),
)
PROBLEMS = {"four-bar": FOUR_BAR, "double pendulum": DOUBLE_PENDULUM, "Andrews": ANDREWS}
