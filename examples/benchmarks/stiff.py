"""Three stiff problems, each as a mechanism of mbdae and as equations written by hand.

    M(q) v' = f(t, q, v) + G(q)^T lam,   G v' = b(t, q, v)

Flyball governor of the IFToMM library, in shaft, slider and one rod's angle, as both rods move equally. A slider-crank
whose massless rod is a spring of 1e8 N/m, damped by 1e4 N s/m. The car axis (Mazzia, Magherini, Test set for initial
value problem solvers, 2008) with eps = 1e-3 instead of 1e-2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from runs import Array
from scipy.integrate import solve_ivp

import mbdae

Terms = tuple[list[list[Any]], list[Any], list[list[Any]], list[Any]]  # M, f, G, b
Start = tuple[mbdae.Mechanism, tuple[Array, Array]]


@dataclass(frozen=True)
class Stiff:
    """A stiff problem.

    Args:
        title: its name.
        end: time in s.
        model: returns the mechanism, and its q and v at the start.
        joints: the joints of the observed coordinates.
        seen: indices of the coordinates in which errors are measured, in m and rad.
        start: q and v of the equations.
        terms: (m, t, q, v) -> M, f, G, b, with m the module that has sin, cos and sqrt.
    """

    title: str
    end: float
    model: Callable[[], Start]
    joints: tuple[str, ...]
    seen: tuple[int, ...]
    start: tuple[tuple[float, ...], tuple[float, ...]]
    terms: Callable[[Any, Any, Any, Any], Terms]

    def acceleration(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return v' (n,) and lam (m,)."""
        M, f, G, b = (np.array(x, float) for x in self.terms(np, t, q, v))
        G = G.reshape(len(b), len(q))
        x = np.linalg.solve(np.block([[M, -G.T], [G, np.zeros((len(b), len(b)))]]), np.concatenate([f, b]))
        return x[: len(q)], x[len(q) :]

    def reference(self) -> Array:
        """The observed coordinates at the end, by an explicit method, whose steps are limited by stability."""
        n, y0 = len(self.start[0]), np.concatenate(self.start)

        def rate(t: float, y: Array) -> Array:
            return np.concatenate([y[n:], self.acceleration(t, y[:n], y[n:])[0]])

        sol = solve_ivp(rate, (0, self.end), y0, method="DOP853", rtol=1e-12, atol=1e-13)
        return sol.y[list(self.seen), -1]


def governor(m: Any, t: Any, q: Any, v: Any) -> Terms:
    """Coordinates: shaft, height of the slider, angle of both rods below the horizontal."""
    _, s, a = (q[i] for i in range(3))
    turn, ds, da = (v[i] for i in range(3))
    c, w, g = m.cos(a), m.sin(a), 9.81
    J = 5.005e-3 + 10 * (0.05 + c) ** 2 + 0.6 * (0.05 + 0.5 * c) ** 2 + 1e-5 * w * w + 0.050005 * c * c
    J_a = -20 * (0.05 + c) * w - 0.6 * (0.05 + 0.5 * c) * w + 2e-5 * w * c - 0.10001 * c * w
    x, z = 0.5 * c, 1 - 0.5 * w - s
    d = m.sqrt(x * x + z * z)
    by_a, by_s = (-0.5 * w * x - 0.5 * c * z) / d, -z / d
    pull = 2 * (8e5 * (d - 0.5) + 4e4 * (by_a * da + by_s * ds))
    M = [[J, 0, 0], [0, 3.0, 0], [0, 0, 10 + 0.15 + 0.050005]]
    f = [-J_a * da * turn, -3 * g - pull * by_s, 0.5 * J_a * turn * turn + 10.3 * g * c - pull * by_a]
    return M, f, [], []


def spring_crank(m: Any, t: Any, q: Any, v: Any) -> Terms:
    """Coordinates: angle of the crank, position of the slider on the x axis."""
    c, w = m.cos(q[0]), m.sin(q[0])
    x, z = q[1] - 0.1 * c, -0.1 * w
    d = m.sqrt(x * x + z * z)
    by = (0.1 * w * x - 0.1 * c * z) / d, x / d
    pull = 1e8 * (d - 0.35) + 1e4 * (by[0] * v[0] + by[1] * v[1])
    return [[0.02, 0], [0, 0.5]], [-pull * by[0], -pull * by[1]], [], []


EPS, MASS, SPEED, ROUGH, REST = 1e-3, 10.0, 10.0, 0.1, 0.5  # of the car axis


def car_axis(m: Any, t: Any, q: Any, v: Any) -> Terms:
    """Coordinates: x and y of the axis over the left and the right wheel."""
    xl, yl, xr, yr = (q[i] for i in range(4))
    ul, wl, ur, wr = (v[i] for i in range(4))
    K = EPS**2 * MASS / 2
    yb, dyb = ROUGH * m.sin(SPEED * t), ROUGH * SPEED * m.cos(SPEED * t)
    xb = m.sqrt(1 - yb * yb)
    dxb, ddyb = -yb * dyb / xb, -(SPEED**2) * yb
    ddxb = -(dyb * dyb + yb * ddyb + dxb * dxb) / xb
    left, right = m.sqrt(xl * xl + yl * yl), m.sqrt((xr - xb) ** 2 + (yr - yb) ** 2)
    pull, push = (REST - left) / left, (REST - right) / right
    f = [pull * xl, pull * yl - K, push * (xr - xb), push * (yr - yb) - K]
    G = [[xb, yb, 0, 0], [xl - xr, yl - yr, xr - xl, yr - yl]]
    b = [-2 * (ul * dxb + wl * dyb) - xl * ddxb - yl * ddyb, -((ul - ur) ** 2) - (wl - wr) ** 2]
    return [[K if i == j else 0 for j in range(4)] for i in range(4)], f, G, b


def _body(model: pin.Model, parent: int, joint: Any, name: str, mass: float, about_y: float = 0.0) -> int:
    i = model.addJoint(parent, joint, pin.SE3.Identity(), name)
    inertia = pin.Inertia(mass, np.zeros(3), np.diag([0.0, about_y, 0.0]) + 1e-12 * np.eye(3))
    model.appendBodyToJoint(i, inertia, pin.SE3.Identity())
    return i


def _frame(model: pin.Model, joint: int, name: str, x: float = 0.0) -> None:
    model.addFrame(pin.Frame(name, joint, pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])), pin.FrameType.OP_FRAME))


def _crank_axis() -> pin.JointModelRevoluteUnaligned:
    return pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))


def spring_crank_model() -> Start:
    """Crank and slider in the x-z plane."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    crank = _body(model, 0, _crank_axis(), "crank", 1.0, 0.02 - 1e-12)
    slider = _body(model, 0, pin.JointModelPX(), "slider", 0.5)
    _frame(model, crank, "crank_pin", 0.1)
    _frame(model, slider, "slider_pin")
    rod = mbdae.SpringDamper(frames=("crank_pin", "slider_pin"), stiffness=1e8, damping=1e4, length=0.35)
    (a, x), (da, dx) = SPRING_CRANK.start
    mech = mbdae.Mechanism(model, [], [rod])
    return mech, mech.assemble({"crank": a, "slider": x}, {"crank": da, "slider": dx})


def car_axis_model() -> Start:
    """The axle turns so that its tip follows the road; the axis is two masses at a distance of 1 m."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -1.0])
    axle = _body(model, 0, _crank_axis(), "axle", 1.0, 1.0)
    road = _body(model, 0, pin.JointModelPZ(), "road", 1.0)
    _frame(model, axle, "left_wheel")
    _frame(model, axle, "right_wheel", 1.0)
    _frame(model, road, "road_frame")
    for side in ("left", "right"):
        x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), f"{side}_x")
        z = _body(model, x, pin.JointModelPZ(), f"{side}_z", EPS**2 * MASS / 2)
        _frame(model, z, side)
    closures = [
        mbdae.Closure.in_plane("road_frame", "right_wheel", name="tip"),
        mbdae.Closure.in_plane("left_wheel", "left", axis=(1, 0, 0), name="upright"),
        mbdae.Closure.distance("left", "right", 1.0, name="axis"),
    ]
    springs = [
        mbdae.SpringDamper(frames=(f"{side}_wheel", side), stiffness=1.0, length=REST) for side in ("left", "right")
    ]
    (q, v), joints = CAR_AXIS.start, CAR_AXIS.joints
    drive = mbdae.Driver.harmonic("road", ROUGH, SPEED)
    mech, turn = mbdae.Mechanism(model, closures, springs, drivers=[drive]), ROUGH * SPEED
    place = {"axle": 0.0, "road": 0.0, **dict(zip(joints, q, strict=True))}
    rate = {"axle": turn, "road": turn, **dict(zip(joints, v, strict=True))}
    return mech, mech.assemble(place, rate)


def governor_model() -> Start:
    """The library's model."""
    mech = mbdae.load("flyball_governor")
    return mech, mech.start


TILT = np.pi / 6
GOVERNOR = Stiff(
    "flyball governor", 10.0, governor_model, ("slider", "rod_1"), (1, 2),
    ((0.0, 0.5, TILT), (2 * np.pi, 0.0, 0.0)), governor,
)  # fmt: skip
REACH = float(np.sqrt(0.35**2 - (0.1 * np.sin(0.3)) ** 2))  # m, of the rod along x at the start
SPRING_CRANK = Stiff(
    "slider-crank, rod of 1e8 N/m", 1.0, spring_crank_model, ("crank", "slider"), (0, 1),
    ((0.3, 0.1 * np.cos(0.3) + REACH), (6.0, -0.6 * np.sin(0.3) * (1 + 0.1 * np.cos(0.3) / REACH))), spring_crank,
)  # fmt: skip
CAR_AXIS = Stiff(
    "car axis, eps = 1e-3", 3.0, car_axis_model, ("left_x", "left_z", "right_x", "right_z"), (0, 1, 2, 3),
    ((0.0, 0.5, 1.0, 0.5), (-0.5, 0.0, -0.5, 0.0)), car_axis,
)  # fmt: skip
STIFF = {p.title: p for p in (GOVERNOR, SPRING_CRANK, CAR_AXIS)}
