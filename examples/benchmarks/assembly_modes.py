"""Random mechanisms with a known number of assembly modes: does the search from random starts find all of them?

platform: a planar 3-RPR, a body on three legs of given lengths. Two legs determine the position of the body at an angle
theta, the third one gives a trigonometric polynomial of degree 3 in theta: up to six real roots. As one body on a
planar joint with three lengths, and as a tree of hinges and slides.

rssr: a crank and a rocker on skew axes, and a rod with ball joints: A cos psi + B sin psi = C, zero or two.

wrist: six hinges, the last three through one point. The centre of the wrist gives a quartic in tan(theta_3/2), and
each of its real roots two orientations of the wrist.

Run it for 200 of each, or with the number of a sample: python assembly_modes.py 10.
"""

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import mbdae
from mbdae import Closure, Driver, Mechanism
from mbdae.mechanism.model_settings import Start

Array = np.ndarray
CLOSE = 1e-4  # rad: cases with real roots closer to each other, or complex ones closer to the real axis, do not count


class Case(NamedTuple):
    """A mechanism, its input, the value, and the number of assembly modes there."""

    mech: Mechanism
    drive: str
    at: float | None
    count: int


def real_angles(value: Callable[[float], Any], degree: int) -> Array | None:
    """Real roots in (-pi, pi] of a trigonometric polynomial; None if some are too close to be counted."""
    n = 2 * degree + 2
    samples = np.array([value(2 * np.pi * k / n) for k in range(n)])
    c = np.fft.fft(samples) / n
    z = np.roots(np.concatenate([c[: degree + 1][::-1], c[-degree:][::-1]]))
    off = np.abs(np.log(np.abs(z)))
    if ((off > 1e-9) & (off < CLOSE)).any():
        return None
    found = np.sort(np.angle(z[off <= 1e-9]))
    gaps = np.abs(np.exp(1j * found[:, None]) - np.exp(1j * found)) + np.eye(len(found)) if len(found) else np.ones(1)
    return found if gaps.min() > CLOSE else None


def platform(seed: int, hinges: bool = False, scale: float = 1.0) -> Case | None:
    """A random planar 3-RPR on a planar joint, or as a tree of three legs of a hinge, a slide and a hinge."""
    rng = np.random.default_rng(seed)
    ground, corners = rng.uniform(-2, 2, (3, 2)), rng.uniform(-1, 1, (3, 2))
    at, theta = rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)
    legs = np.linalg.norm(at + corners @ rotation(theta).T - ground, axis=1)
    found = real_angles(lambda x: _legs_close(x, ground, corners, legs), 3)
    if found is None:
        return None
    make = _platform_of_legs if hinges else _platform
    mech, drive = make(scale * ground, scale * corners, scale * legs, scale * at, theta)
    return Case(mech, drive, None, len(found))


def rotation(theta: float) -> Array:
    """Return the rotation matrix of an angle in the plane."""
    return np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])


def _legs_close(theta: float, ground: Array, corners: Array, legs: Array) -> float:
    """|D p|^2 - (D L_0)^2 for the position p of the first corner from its ground that satisfies the other two legs.

    |p + e_i|^2 = L_i^2 with e_i = R (b_i - b_0) - (a_i - a_0): minus |p|^2 = L_0^2 they are linear in p, A p = b with
    D = det A.
    """
    e = (corners[1:] - corners[0]) @ rotation(theta).T - (ground[1:] - ground[0])
    A, b = 2 * e, legs[1:] ** 2 - legs[0] ** 2 - (e**2).sum(axis=1)
    D = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    p = np.array([A[1, 1] * b[0] - A[0, 1] * b[1], A[0, 0] * b[1] - A[1, 0] * b[0]])
    return float(p @ p - (D * legs[0]) ** 2)


def _platform(ground: Array, corners: Array, legs: Array, at: Array, theta: float) -> tuple[Mechanism, str]:
    model = pin.Model()
    body = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(body, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    drivers = []
    for i in range(3):
        mark(model, 0, ground[i], f"ground_{i}")
        mark(model, body, corners[i], f"corner_{i}")
        drivers.append(Driver(frames=(f"ground_{i}", f"corner_{i}"), motion=float(legs[i]), name=f"leg_{i}"))
    start = Start(guess={"body": (*at.tolist(), np.cos(theta), np.sin(theta))})
    return Mechanism(model, drivers=drivers, start=start), "leg_0"


def _platform_of_legs(ground: Array, corners: Array, legs: Array, at: Array, theta: float) -> tuple[Mechanism, str]:
    model, guess, holds = pin.Model(), {}, []
    for i in range(3):
        span = at + rotation(theta) @ corners[i] - ground[i]
        angle = np.arctan2(span[1], span[0])
        place = pin.SE3(np.eye(3), np.append(ground[i], 0.0))
        hinge = model.addJoint(0, pin.JointModelRZ(), place, f"hinge_{i}")
        slide = model.addJoint(hinge, pin.JointModelPX(), pin.SE3.Identity(), f"leg_{i}")
        model.appendBodyToJoint(slide, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        guess |= {f"hinge_{i}": float(angle), f"leg_{i}": float(legs[i])}
        holds.append(Driver(joint=f"leg_{i}", motion=float(legs[i]), name=f"length_{i}"))
        mark(model, slide, np.zeros(2), f"tip_{i}")
        if not i:
            body = model.addJoint(slide, pin.JointModelRZ(), pin.SE3.Identity(), "body")
            model.appendBodyToJoint(body, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
            guess["body"] = float(theta - angle)
        else:
            mark(model, body, corners[i] - corners[0], f"corner_{i}")
    pins = [Closure.point(f"corner_{i}", f"tip_{i}", name=f"pin_{i}") for i in (1, 2)]
    return Mechanism(model, pins, drivers=holds, start=Start(guess=guess)), "length_0"


def mark(model: pin.Model, joint: int, place: Array, name: str) -> None:
    """A frame at a point of a joint, in the plane or in space."""
    at = np.concatenate([place, np.zeros(3 - len(place))])
    model.addFrame(pin.Frame(name, joint, pin.SE3(np.eye(3), at), pin.FrameType.OP_FRAME))


def rssr(seed: int) -> Case:
    """A crank and a rocker on random axes, with a rod between their tips."""
    rng = np.random.default_rng(seed)
    model, tips = pin.Model(), []
    for name in ("crank", "rocker"):
        place, axis, tip = rng.uniform(-1, 1, 3), unit(rng), rng.uniform(-1, 1, 3)
        hinge(model, 0, place, axis, name)
        mark(model, model.njoints - 1, tip, f"{name}_tip")
        tips.append((place, axis, tip))
    start, at = rng.uniform(-np.pi, np.pi, 2), float(rng.uniform(-np.pi, np.pi))

    def reached(which: int, angle: float) -> Array:
        place, axis, tip = tips[which]
        return place + pin.exp3(axis * angle) @ tip

    rod = float(np.linalg.norm(reached(0, start[0]) - reached(1, start[1])))
    place, axis, tip = tips[1]
    span, across = reached(0, at) - place, tip - axis * (axis @ tip)
    A, B = 2 * span @ across, 2 * span @ np.cross(axis, across)
    C = span @ span + tip @ tip - 2 * (span @ axis) * (axis @ tip) - rod**2
    mech = Mechanism(
        model,
        [Closure.distance("crank_tip", "rocker_tip", rod, name="rod")],
        start=Start(q={"crank": start[0]}, guess={"rocker": start[1]}),
    )
    return Case(mech, "crank", at, 2 if A * A + B * B > C * C else 0)


def wrist(seed: int) -> Case | None:
    """Six hinges on random axes, the last three concurrent and orthogonal, whose end a seventh one moves.

    The centre of the wrist is p_1 + R_1 (p_2 + R_2 w), w = p_3 + R_3 p_4. Its distance from p_1 and its height along
    the first axis do not depend on theta_1 and are linear in R_2 w_n, where w_n is w across the second axis: two
    equations B R_2 w_n = k, solvable where |B^-1 k| = |w_n|, of degree 2 in cos and sin of theta_3.
    """
    rng = np.random.default_rng(seed)
    model = pin.Model()
    p, a, angles = rng.uniform(-1, 1, (4, 3)), [unit(rng) for _ in range(3)], rng.uniform(-np.pi, np.pi, 6)
    parent = 0
    for i in range(3):
        parent = hinge(model, parent, p[i], a[i], f"arm_{i + 1}")
    for i in range(3):
        parent = hinge(model, parent, np.zeros(3) if i else p[3], np.eye(3)[i], f"wrist_{i + 1}")
    end = pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-0.5, 0.5, 3))
    model.addFrame(pin.Frame("end", parent, end, pin.FrameType.OP_FRAME))
    where, axis = rng.uniform(-1, 1, 3), unit(rng)
    data = model.createData()
    pin.forwardKinematics(model, data, angles)
    target = pin.SE3(np.eye(3), where).actInv(data.oMi[parent] * end)
    centre = data.oMi[parent].translation.copy()
    driven = hinge(model, 0, where, axis, "drive")
    model.addFrame(pin.Frame("target", driven, target, pin.FrameType.OP_FRAME))
    across = np.linalg.svd(a[1][None])[2][1:]  # (2, 3): axes across the second one
    B = np.array([2 * across @ p[1], across @ a[0]])
    reach = centre - p[0]

    def misses(theta: float) -> float:
        w = p[2] + pin.exp3(a[2] * theta) @ p[3]
        along = a[1] @ w
        squares = reach @ reach - p[1] @ p[1] - w @ w - 2 * (p[1] @ a[1]) * along
        height = a[0] @ reach - a[0] @ p[1] - (a[0] @ a[1]) * along
        found = np.linalg.solve(B, [squares, height])
        return float(found @ found - (w @ w - along**2))

    elbows = real_angles(misses, 2)
    if elbows is None:
        return None
    start = Start(q={"drive": 0.0}, guess=dict(zip(list(model.names)[1:7], angles.tolist(), strict=True)))
    mech = Mechanism(model, [Closure.frame("end", "target", name="grip")], start=start)
    return Case(mech, "drive", 0.0, 2 * len(elbows))


def hinge(model: pin.Model, parent: int, place: Array, axis: Array, name: str) -> int:
    """A hinge with a small body."""
    joint = model.addJoint(parent, pin.JointModelRevoluteUnaligned(axis), pin.SE3(np.eye(3), place), name)
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    return int(joint)


def unit(rng: np.random.Generator) -> Array:
    """A random direction."""
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


FAMILIES: dict[str, Callable[[int], Case | None]] = {
    "platform": platform,
    "platform of legs": lambda seed: platform(seed, hinges=True),
    "rssr": rssr,
    "wrist": wrist,
}


class Outcome(NamedTuple):
    """For each number of modes, the cases of a family, and those with a wrong count."""

    cases: int
    counts: dict[int, int]
    missed: list[tuple[int, int, int]]  # seed, modes found, true number
    reported: int  # of those, by a line "doubtful"
    surplus: list[tuple[int, int, int]]

    def __str__(self) -> str:
        there = ", ".join(f"{n} modes {k} times" for n, k in sorted(self.counts.items()))
        text = f"{self.cases} cases ({there}): {len(self.missed)} undercounted, {self.reported} of them reported"
        return f"{text}, {len(self.surplus)} overcounted"


def ensemble(family: str, cases: int, first: int = 0) -> Outcome:
    """Search the assembly modes of random mechanisms of a family, and compare their number with the known one."""
    counts: dict[int, int] = {}
    missed, surplus, reported, seed = [], [], 0, first
    while sum(counts.values()) < cases:
        case, seed = FAMILIES[family](seed), seed + 1
        if case is None:  # modes too close to each other to be counted
            continue
        found, doubtful = search(case)
        counts[case.count] = counts.get(case.count, 0) + 1
        if found < case.count:
            missed.append((seed - 1, found, case.count))
            reported += doubtful
        elif found > case.count:
            surplus.append((seed - 1, found, case.count))
    return Outcome(cases, counts, missed, reported, surplus)


def search(case: Case) -> tuple[int, bool]:
    """The number of modes found, and whether it is reported as doubtful."""
    try:
        found = mbdae.assembly_modes(case.mech, case.drive, case.at)
    except mbdae.MbdaeError:
        return 0, False
    return len(found.modes), bool(found.warnings)


def main(cases: int = 200) -> dict[str, Outcome]:
    """Count the assembly modes of this many random mechanisms of each family."""
    out = {}
    for family in FAMILIES:
        out[family] = ensemble(family, cases)
        print(f"{family}: {out[family]}")
        for seed, found, there in (*out[family].missed, *out[family].surplus):
            print(f"  seed {seed}: {found} of {there}")
    return out


if __name__ == "__main__":
    main(*(int(x) for x in sys.argv[1:]))
