"""The descriptions of `random_bodies` as SDF, URDF and MJCF files, with the variants that the formats allow."""

import xml.etree.ElementTree as ET

import numpy as np
from random_bodies import WORLD, G
from scipy.spatial.transform import Rotation


def text(x):
    return " ".join(repr(float(c)) for c in np.atleast_1d(x))


def rpy(R):
    return Rotation.from_matrix(R).as_euler("xyz")


def relative(A, B):
    """Return the frame B relative to A, both (R, p)."""
    return A[0].T @ B[0], A[0].T @ (B[1] - A[1])


def rotated_inertia(I, S):  # noqa: E741
    return S.T @ I @ S


ENTRIES = [("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2)]


# -- SDF ---------------------------------------------------------------------------------------------------------------


def sub(parent, tag, content="", **attributes):
    e = ET.SubElement(parent, tag, attributes)
    e.text = content or None
    return e


def to_sdf(of, rng):
    """Write SDF: poses and axes relative to other frames, joints between frames, if the version supports them."""
    version = str(rng.choice(["1.4", "1.6", "1.7", "1.9", "1.11"]))
    number, late = tuple(map(int, version.split("."))), version in ("1.7", "1.9", "1.11")
    if any(j.mimic for j in of.joints):
        version, late, number = "1.11", True, (1, 11)
    sdf = ET.Element("sdf", version=version)
    world = sub(sdf, "world", name="w")
    sub(world, "gravity", text(G))
    model = sub(world, "model", name="m")
    origin = Rotation.random(random_state=rng).as_matrix(), rng.uniform(-1, 1, 3)
    place = {n: (b.R, b.p) for n, b in of.bodies.items()}
    known = {"": origin}

    def pose(e, base, target, choices=()):
        attributes, style = {}, rng.integers(3)
        if late and choices and rng.random() < 0.4:
            name = str(rng.choice(list(choices)))
            attributes["relative_to"], base = name, known[name]
        R, p = relative(base, target)
        turn = rpy(R)
        if style == 1 and number >= (1, 9):
            attributes["rotation_format"], turn = "quat_xyzw", Rotation.from_matrix(R).as_quat()
        elif style == 2 and number >= (1, 9):
            attributes["degrees"], turn = "true", np.degrees(turn)
        sub(e, "pose", f"{text(p)} {text(turn)}", **attributes)

    pose(model, (np.eye(3), np.zeros(3)), origin)
    for n, b in of.bodies.items():
        e = sub(model, "link", name=n)
        pose(e, origin, place[n], [k for k in known if k])
        known[n] = place[n]
        if not b.weight:
            sub(e, "gravity", str(rng.choice(["false", "0"])))
        inertial, S = sub(e, "inertial"), Rotation.random(random_state=rng).as_matrix()
        R, p = relative(place[n], (b.R @ S, b.centre))
        sub(inertial, "pose", f"{text(p)} {text(rpy(R))}")
        sub(inertial, "mass", text(b.mass))
        tensor = sub(inertial, "inertia")
        for key, i, k in ENTRIES:
            sub(tensor, key, text(rotated_inertia(b.I, S)[i, k]))
    frames = {}
    for j in of.joints + of.loops:
        for link in (j.parent, j.child):
            if late and link != WORLD and rng.random() < 0.3 and link not in frames:
                frame = frames[link] = f"{link}_f"
                known[frame] = Rotation.random(random_state=rng).as_matrix(), rng.uniform(-1, 1, 3)
                pose(sub(model, "frame", name=frame, attached_to=link), place[link], known[frame])
    order = of.joints + of.loops
    for j in [order[i] for i in rng.permutation(len(order))]:
        kind = "continuous" if j.kind == "revolute" and rng.random() < 0.3 else j.kind
        e = sub(model, "joint", name=j.name, type=kind)
        ends = [frames.get(x, x) if rng.random() < 0.5 else x for x in (j.parent, j.child)]
        sub(e, "parent", ends[0])
        sub(e, "child", ends[1])
        here, links = (j.R, j.p), [n for n in of.bodies]
        pose(e, known[ends[1]], here, links)
        for tag, k in zip(("axis", "axis2"), range(len(j.axes)), strict=False):
            a, xyz, base = sub(e, tag), {}, j.R
            if number <= (1, 4):
                base = origin[0]
            elif not late and rng.random() < 0.5:
                sub(a, "use_parent_model_frame", "1")
                base = origin[0]
            elif late and rng.random() < 0.5:
                xyz["expressed_in"] = str(rng.choice(["__model__", *links]))
                base = origin[0] if xyz["expressed_in"] == "__model__" else place[xyz["expressed_in"]][0]
            sub(a, "xyz", text(base.T @ j.axes[k] * rng.uniform(0.5, 2)), **xyz)
            if j.damping and (j.damping[k] or j.stiffness):
                dynamics = sub(a, "dynamics")
                sub(dynamics, "damping", text(j.damping[k]))
                if j.stiffness:
                    sub(dynamics, "spring_stiffness", text(j.stiffness))
                    sub(dynamics, "spring_reference", text(j.rest))
            if j.mimic:
                m, shift = sub(a, "mimic", joint=j.mimic[0]), float(rng.uniform(-1, 1))
                sub(m, "multiplier", text(j.mimic[1]))
                sub(m, "reference", text(shift))
                sub(m, "offset", text(shift * j.mimic[1]))
    return ET.tostring(sdf, encoding="unicode")


# -- URDF --------------------------------------------------------------------------------------------------------------


def to_urdf(of, rng):
    """Write URDF: a tree from the world, in which the frame of a link is that of its joint."""
    robot = ET.Element("robot", name="r", version=str(rng.choice(["1.0", "1.1"])))
    frame = {WORLD: (np.eye(3), np.zeros(3)), **{j.child: (j.R, j.p) for j in of.joints}}
    sub(robot, "link", name="base")
    kinds = {"free": "floating", "revolute": "continuous"}
    led = {n for j in of.joints if j.mimic for n in (j.name, j.mimic[0])}  # continuous joints cannot lead or follow

    def origin(e, R, p):
        if robot.get("version") == "1.1" and rng.random() < 0.5:
            sub(e, "origin", xyz=text(p), quat_xyzw=text(Rotation.from_matrix(R).as_quat()))
        else:
            sub(e, "origin", xyz=text(p), rpy=text(rpy(R)))

    for n, b in of.bodies.items():
        inertial, S = sub(sub(robot, "link", name=n), "inertial"), Rotation.random(random_state=rng).as_matrix()
        origin(inertial, *relative(frame[n], (b.R @ S, b.centre)))
        sub(inertial, "mass", value=text(b.mass))
        sub(inertial, "inertia", **{key: text(rotated_inertia(b.I, S)[i, k]) for key, i, k in ENTRIES})
    for j in [of.joints[i] for i in rng.permutation(len(of.joints))]:
        kind = j.kind if j.name in led else kinds.get(j.kind, j.kind)
        e = sub(robot, "joint", name=j.name, type=kind)
        sub(e, "parent", link="base" if j.parent == WORLD else j.parent)
        sub(e, "child", link=j.child)
        origin(e, *relative(frame[j.parent], frame[j.child]))
        if j.axes:
            sub(e, "axis", xyz=text(j.R.T @ j.axes[0]))
        if kind in ("revolute", "prismatic"):
            sub(e, "limit", lower="-100", upper="100", effort="0", velocity="0")
        if j.damping:
            sub(e, "dynamics", damping=text(j.damping[0]))
        if j.mimic:
            sub(e, "mimic", joint=j.mimic[0], multiplier=text(j.mimic[1]))
    return ET.tostring(robot, encoding="unicode")


# -- MJCF --------------------------------------------------------------------------------------------------------------


def to_mjcf(of, rng):
    """Write MJCF: nested bodies, loops by connect, coupled joints, some values by default classes."""
    root = ET.Element("mujoco", model="m")
    sub(root, "compiler", angle="radian", autolimits="true")
    sub(root, "option", gravity=text(G))
    common = sub(sub(root, "default"), "default", **{"class": "c"})
    sub(common, "joint", damping="0.7")
    elements = {WORLD: sub(root, "worldbody")}
    place = {WORLD: (np.eye(3), np.zeros(3)), **{n: (b.R, b.p) for n, b in of.bodies.items()}}
    kinds = {"revolute": "hinge", "prismatic": "slide", "ball": "ball"}
    for j in of.joints:  # parents come first
        b = of.bodies[j.child]
        R, p = relative(place[j.parent], place[j.child])
        where = {"quat": text(np.roll(Rotation.from_matrix(R).as_quat(), 1))}
        e = elements[b.name] = sub(elements[j.parent], "body", name=b.name, pos=text(p), **where)
        if not b.weight:
            e.set("gravcomp", "1")
        R, p = np.eye(3), b.com
        tensor = {"fullinertia": text([b.I[i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])}
        sub(e, "inertial", pos=text(p), mass=text(b.mass), **tensor)
        if j.kind == "free":
            sub(e, "freejoint", name=j.name)
        elif j.kind != "fixed":
            at = place[j.child][0].T @ (j.p - place[j.child][1])
            joint = sub(e, "joint", name=j.name, type=kinds[j.kind], pos=text(at))
            if j.axes:
                joint.set("axis", text(place[j.child][0].T @ j.axes[0]))
            if j.damping and rng.random() < 0.3:
                j.damping = [0.7]
                joint.set("class", "c")
            elif j.damping:
                joint.set("damping", text(j.damping[0]))
            if j.stiffness:
                joint.set("stiffness", text(j.stiffness))
                joint.set("springref", text(j.rest))
    equality = sub(root, "equality")
    for j in of.loops:
        anchor = place[j.child][0].T @ (j.p - place[j.child][1])
        sub(equality, "connect", name=j.name, body1=j.child, body2=WORLD, anchor=text(anchor))
    for j in of.joints:
        if j.mimic:
            sub(equality, "joint", joint1=j.name, joint2=j.mimic[0], polycoef=f"0 {text(j.mimic[1])} 0 0 0")
    return ET.tostring(root, encoding="unicode")


# -- unknown elements --------------------------------------------------------------------------------------------------


def with_unknown_elements(content, rng, count=3):
    """Insert random elements, attributes and texts into a file; return it, and the last parts of their paths."""
    root, last = ET.fromstring(content), []
    for i in range(count):
        spots = [e for e in root.iter() if not e.tag.startswith("plant")]
        e, kind = spots[rng.integers(len(spots))], rng.integers(3)
        if kind == 0:
            ET.SubElement(e, f"plant{i}", name=f"seed{i}").text = "1"
        elif kind == 1:
            e.set(f"plant{i}", "1")
        else:
            ET.SubElement(e, f"plant{i}", more="x").tail = "stray"
            last.append("text()")
        last.append(f"@plant{i}" if kind == 1 else f"plant{i}")
    return ET.tostring(root, encoding="unicode"), last
