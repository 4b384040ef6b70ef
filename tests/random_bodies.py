"""Random mechanisms as descriptions of bodies and joints, and their accelerations in maximal coordinates.

The reference uses neither trees nor files, but bodies in the world and joints between them: the Newton-Euler equations
of each body, and for every joint the constraints at acceleration level, solved together.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

WORLD, G = "world", np.array([0.3, -0.2, -9.81])


@dataclass
class Body:
    """Frames of a body and of its centre of mass, and its inertia about the centre of mass in axes of the body."""

    name: str
    R: np.ndarray
    p: np.ndarray
    mass: float
    com: np.ndarray
    I: np.ndarray  # noqa: E741
    weight: bool = True

    @property
    def centre(self):
        return self.p + self.R @ self.com


@dataclass
class Joint:
    """A joint: its frame in the world, unit axes in the world, and the efforts along them."""

    name: str
    kind: str  # revolute, prismatic, universal, ball, fixed, planar, free
    parent: str
    child: str
    R: np.ndarray
    p: np.ndarray
    axes: list
    damping: list = field(default_factory=list)
    stiffness: float = 0.0
    rest: float = 0.0
    mimic: tuple = ()  # leader, ratio

    @property
    def angular(self):
        return self.kind in ("revolute", "universal")


@dataclass
class RandomMechanism:
    """Bodies by name, the joints of a tree, and the joints that close loops."""

    bodies: dict
    joints: list
    loops: list


def turn(rng):
    return Rotation.random(random_state=rng).as_matrix()


def unit(rng):
    x = rng.standard_normal(3)
    return x / np.linalg.norm(x)


def across(n):
    """Return two unit vectors perpendicular to n and to each other."""
    a = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    a /= np.linalg.norm(a)
    return a, np.cross(n, a)


def random_body(name, rng, weightless=0.0):
    S, d = turn(rng), rng.uniform(0.02, 0.1, 3)  # principal moments d_j + d_k satisfy the triangle inequality
    tensor = S @ np.diag(d.sum() - d) @ S.T
    place = turn(rng), rng.uniform(-1, 1, 3)
    return Body(name, *place, rng.uniform(0.5, 3), rng.uniform(-0.3, 0.3, 3), tensor, rng.random() >= weightless)


def random_joint(name, kind, parent, child, rng, *, springs, axis=None, own_frame=None):
    n = unit(rng) if axis is None else axis
    axes = {"universal": [n, across(n)[0]], "ball": [], "fixed": [], "free": []}.get(kind, [n])
    j = Joint(name, kind, parent, child, turn(rng) if own_frame is None else own_frame, rng.uniform(-1, 1, 3), axes)
    if kind in ("revolute", "prismatic", "universal"):
        j.damping = [float(x) for x in rng.uniform(0, 2, len(axes)) * (rng.random() < 0.6)]
    if springs and kind in ("revolute", "prismatic") and rng.random() < 0.5:
        j.stiffness, j.rest = rng.uniform(1, 20), rng.uniform(-0.5, 0.5)
    return j


def random_mechanism(seed, kinds, *, springs=True, mimics=True, loops=True, weightless=0.3):
    """Return a tree of 2 to 6 bodies; with ``loops`` perhaps a planar ring, or a spatial one closed by a ball joint."""
    rng = np.random.default_rng(seed)
    bodies = {f"b{i}": random_body(f"b{i}", rng, weightless) for i in range(rng.integers(2, 7))}
    names, joints, loop_joints = list(bodies), [], []
    ring = loops and len(names) >= 3 and rng.random() < 0.7
    planar, n = bool(ring and rng.random() < 0.6), unit(rng)
    for i, name in enumerate(names):
        if ring:
            parent = names[i - 1] if i else WORLD
            kind = "revolute" if planar else str(rng.choice(["revolute", "universal", "ball"]))
            kind = kind if kind in kinds else "revolute"
        else:
            parent = str(rng.choice([WORLD, *names[:i]]))
            kind = str(rng.choice([k for k in kinds if k != "free" or parent == WORLD]))
        own_frame = bodies[name].R if kind == "ball" else None
        axis = n if planar else None
        joints.append(random_joint(f"j{i}", kind, parent, name, rng, springs=springs, axis=axis, own_frame=own_frame))
    if ring:
        kind = ("prismatic" if rng.random() < 0.3 and len(names) > 3 else "revolute") if planar else "ball"
        axis = across(n)[0] if kind == "prismatic" else n if planar else None
        joint = random_joint("close", kind, WORLD, names[-1], rng, springs=springs, axis=axis)
        loop_joints.append(joint)
    single = [j for j in joints if j.kind in ("revolute", "prismatic")]
    if mimics and not ring and len(single) > 1 and rng.random() < 0.6:
        single[-1].mimic = (single[0].name, float(rng.uniform(0.5, 2)))
    return RandomMechanism(bodies, joints, loop_joints)


def accelerations(mechanism, twists):
    """Return accelerations (v' of the centre of mass, w') of bodies for twists (v, w), all in the world."""
    names = list(mechanism.bodies)
    at = {n: 6 * i for i, n in enumerate(names)}
    size, M, f = 6 * len(names), np.zeros((6 * len(names),) * 2), np.zeros(6 * len(names))
    for n, b in mechanism.bodies.items():
        i, w = at[n], twists[n][1]
        inertia = b.R @ b.I @ b.R.T
        M[i : i + 3, i : i + 3], M[i + 3 : i + 6, i + 3 : i + 6] = b.mass * np.eye(3), inertia
        f[i : i + 3] = b.mass * G * b.weight
        f[i + 3 : i + 6] = -np.cross(w, inertia @ w)
    rows, rhs, rate = [], [], {}

    def relative(j, x):
        """Return the row of x . (relative acceleration of points at the joint), and the row of x . (w_c' - w_p')."""
        point, angle, bias = np.zeros(size), np.zeros(size), 0.0
        for link, sign in ((j.child, 1), (j.parent, -1)):
            if link != WORLD:
                i, r, w = at[link], j.p - mechanism.bodies[link].centre, twists[link][1]
                point[i : i + 3] += sign * x
                point[i + 3 : i + 6] += sign * np.cross(r, x)
                angle[i + 3 : i + 6] += sign * x
                bias += sign * x @ np.cross(w, np.cross(w, r))
        return point, angle, bias

    for j in (*mechanism.joints, *mechanism.loops):
        (vc, wc), (vp, wp) = (twists.get(n, (np.zeros(3),) * 2) for n in (j.child, j.parent))
        speed = [v + np.cross(w, j.p - mechanism.bodies[n].centre) if n != WORLD else np.zeros(3)
                 for n, v, w in ((j.child, vc, wc), (j.parent, vp, wp))]  # fmt: skip
        u, spin = speed[0] - speed[1], wc - wp

        def constrain_point(x, moving, j=j, u=u, wp=wp):
            point, _, bias = relative(j, x)
            rows.append(point)
            rhs.append(-bias - (2 * np.cross(wp, x) @ u if moving else 0.0))

        def constrain_rotation(x, change, j=j, spin=spin):
            rows.append(relative(j, x)[1])
            rhs.append(-change @ spin)

        n = j.axes[0] if j.axes else None
        if j.kind in ("revolute", "universal", "ball", "fixed"):
            for x in np.eye(3):
                constrain_point(x, False)
        elif j.kind == "prismatic":
            for x in across(n):
                constrain_point(x, True)
        elif j.kind == "planar":
            constrain_point(n, True)
        if j.kind in ("fixed", "prismatic"):
            for x in np.eye(3):
                constrain_rotation(x, np.zeros(3))
        elif j.kind in ("revolute", "planar"):
            for x in across(n):
                constrain_rotation(x, np.cross(wp, x))
        elif j.kind == "universal":
            a, b = j.axes
            constrain_rotation(np.cross(a, b), np.cross(np.cross(wp, a), b) + np.cross(a, np.cross(wc, b)))
        for k, x in enumerate(j.axes if j.kind in ("revolute", "prismatic", "universal") else ()):
            point, angle, bias = relative(j, x)
            row, q = (angle, x @ spin) if j.angular else (point, x @ u)
            f += row * (-j.damping[k] * q + j.stiffness * j.rest)
            bias_rate = np.cross(wp, x) @ spin if j.angular else bias + 2 * np.cross(wp, x) @ u
            rate[j.name] = row, bias_rate
    for j in mechanism.joints:
        if j.mimic:
            (row, bias_rate), (leader_row, other) = rate[j.name], rate[j.mimic[0]]
            rows.append(row - j.mimic[1] * leader_row)
            rhs.append(j.mimic[1] * other - bias_rate)
    J = np.array(rows).reshape(-1, size)
    K = np.block([[M, J.T], [J, np.zeros((len(J), len(J)))]])
    solution = np.linalg.lstsq(K, np.concatenate([f, np.array(rhs)]), rcond=1e-12)[0][:size]
    assert np.abs(J @ solution - rhs).max(initial=0) < 1e-8 * (1 + np.abs(rhs).max(initial=0))
    return {n: (solution[i : i + 3], solution[i + 3 : i + 6]) for n, i in at.items()}
