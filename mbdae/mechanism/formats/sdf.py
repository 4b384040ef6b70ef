"""SDF: links, joints and loops of one model, see sdformat.org.

SDF is a graph of links. From the world, and from links that no joint carries, joints are followed from parent to
child; a joint to a link that is there already is cut and becomes a closure. Links that nothing carries fly freely, but
those of a static model.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ...errors import InputError
from ..closures.closure import Closure
from ..forces.joint_spring import JointSpring
from ..frames import WORLD
from ..part import Part, listed
from ..plain import written
from ..scene.shapes import pack
from ..tables import HUGE

MODEL, OWN = "__model__", "the model"
MOVING: dict[str, Callable[..., Any]] = {
    "revolute": pin.JointModelRevoluteUnaligned,
    "continuous": pin.JointModelRevoluteUnaligned,
    "prismatic": pin.JointModelPrismaticUnaligned,
    "universal": pin.JointModelUniversal,
    "ball": pin.JointModelSpherical,
}
AXES = {"revolute": 1, "continuous": 1, "prismatic": 1, "universal": 2, "ball": 0, "fixed": 0}
CLOSED = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "universal": "universal",
          "ball": "point", "fixed": "frame"}  # fmt: skip


@dataclass(frozen=True)
class SdfJoint:
    """A joint: its kind, the links that it joins, its place in the world, and its axes in its own frame."""

    name: str
    kind: str
    parent: str
    child: str
    place: pin.SE3
    axes: tuple[tuple[float, ...], ...]
    element: ET.Element


def read_sdf(text: str, name: str) -> Part:
    """Read an SDF text.

    Raises:
        InputError: for a text that is no SDF of one model, or for what it says and is not read: names it.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as e:
        raise InputError(f"{name} is not XML: {e}") from None
    models = [m for m in (*root.findall("model"), *root.findall("world/model"))]
    if root.tag != "sdf" or len(models) != 1:
        raise InputError(f"{name}: expected <sdf> with one <model>, got <{root.tag}> with {len(models)}")
    return SdfModel(models[0], name).part(root.find("world/gravity"))


class SdfModel:
    """The model of an SDF file, and the Pinocchio model that grows from it."""

    def __init__(self, element: ET.Element, name: str) -> None:
        self.file, self.element = name, element
        if unread := [e.tag for e in element if e.tag in ("model", "include")]:
            raise InputError(f"{name}: <{unread[0]}> within a model is not read")
        self.elements = {self._name(e): e for e in element if e.tag in ("link", "joint", "frame")}
        self.links = {n: self.place(n) for n, e in self.elements.items() if e.tag == "link"}
        self.joints = [self._joint(n, e) for n, e in self.elements.items() if e.tag == "joint"]
        self.model = pin.Model()
        self.model.name = element.get("name", name)
        self.home: dict[str, int] = {WORLD: 0}  # the joint that carries a link
        self.origins = [pin.SE3.Identity()]  # of joints in the world
        self.tree: list[SdfJoint] = []

    def part(self, gravity: ET.Element | None) -> Part:
        """What the file says, as a part of a mechanism."""
        roots = self._span()
        self._grow(WORLD)
        static = self.element.findtext("static", "").strip() in ("1", "true")
        for link in roots:
            self.home[link] = 0 if static else self._add(0, pin.JointModelFreeFlyer(), self.links[link], f"{link} free")
            self._carry(link)
            self._grow(link)
        for name, e in self.elements.items():
            if e.tag == "frame":
                self._frame(name, self._carrier(e), self.place(name), pin.FrameType.OP_FRAME)
        closures, springs = [self._close(j) for j in self.joints if j not in self.tree], list(self._springs())
        visuals, shapeless = self._visuals()
        left = (("shapes", shapeless), ("friction of joints", self._rubbing()))
        return Part(
            self.model, visuals, lambda: {"model": written(self.model), "visuals": pack(visuals)},
            gravity=None if gravity is None else tuple(self._numbers(gravity.text, 3, "gravity")),
            closures=tuple(closures), forces=tuple(springs), left_out=tuple(listed(w, n) for w, n in left if n),
        )  # fmt: skip

    # -- reading ------------------------------------------------------------------------------------------------

    def _name(self, e: ET.Element) -> str:
        name = e.get("name", "")
        if not name or sum(x.get("name") == name for x in self.element if x.tag == e.tag) > 1:
            raise InputError(f"{self.file}: each <{e.tag}> needs a name of its own, got {name!r}")
        return name

    def place(self, name: str, seen: tuple[str, ...] = ()) -> pin.SE3:
        """Where a link, joint or frame stands in the world."""
        if name in ("", MODEL):
            return self._pose(self.element, OWN)
        if name == WORLD:
            return pin.SE3.Identity()
        if name not in self.elements or name in seen:
            raise InputError(f"{self.file}: {name!r} is no link, joint or frame, or placed relative to itself")
        e = self.elements[name]
        base = e.get("attached_to", "") if e.tag == "frame" else (e.findtext("child") or "").strip()
        pose = e.find("pose")
        other = (None if pose is None else pose.get("relative_to")) or (base if e.tag != "link" else "")
        return self.place(other, (*seen, name)) * self._pose(e, name)

    def _pose(self, e: ET.Element, name: str) -> pin.SE3:
        pose = e.find("pose")
        if pose is None or not (pose.text or "").strip():
            return pin.SE3.Identity()
        if pose.get("rotation_format", "euler_rpy") != "euler_rpy":
            raise InputError(f"{self.file}: the pose of {name!r} is no roll, pitch and yaw")
        x = np.array(self._numbers(pose.text, 6, f"the pose of {name!r}"))
        turn = np.radians(x[3:]) if pose.get("degrees") in ("true", "1") else x[3:]
        return pin.SE3(pin.rpy.rpyToMatrix(turn), x[:3])

    def _numbers(self, text: str | None, n: int, what: str) -> list[float]:
        try:
            out = [float(x) for x in (text or "").split()]
        except ValueError:
            out = []
        if len(out) != n or not all(abs(x) <= HUGE for x in out):
            raise InputError(f"{self.file}: {what} takes {n} finite numbers, got {(text or '')[:60]!r}")
        return out

    def _number(self, e: ET.Element | None, path: str, default: float, what: str) -> float:
        text = None if e is None else e.findtext(path)
        return default if text is None else self._numbers(text, 1, what)[0]

    def _joint(self, name: str, e: ET.Element) -> SdfJoint:
        kind, (parent, child) = e.get("type", ""), ((e.findtext(k) or "").strip() for k in ("parent", "child"))
        if kind not in AXES:
            raise InputError(f"{self.file}: joint {name!r} is of kind {kind!r}; known: {', '.join(AXES)}")
        for link in (parent, child):
            if link not in self.links and link != WORLD:
                raise InputError(f"{self.file}: joint {name!r} joins {link!r}, which is no link; links: "
                                 f"{', '.join(self.links)}")  # fmt: skip
        place = self.place(name)
        axes = tuple(tuple(self._axis(name, e.find(tag), place)) for tag in ("axis", "axis2")[: AXES[kind]])
        return SdfJoint(name, kind, parent, child, place, axes, e)

    def _axis(self, joint: str, e: ET.Element | None, place: pin.SE3) -> list[float]:
        found = None if e is None else e.find("xyz")
        axis = np.array(self._numbers("0 0 1" if found is None else found.text, 3, f"the axis of joint {joint!r}"))
        if not np.linalg.norm(axis) > 0:
            raise InputError(f"{self.file}: the axis of joint {joint!r} is no direction")
        own = e is not None and e.findtext("use_parent_model_frame", "").strip() in ("1", "true")
        frame = MODEL if own else None if found is None else found.get("expressed_in")
        turned = axis if not frame else place.rotation.T @ self.place(frame).rotation @ axis
        return (turned / np.linalg.norm(turned)).tolist()

    # -- the tree ------------------------------------------------------------------------------------------------

    def _span(self) -> list[str]:
        """Choose the joints of the tree, nearest to the world first; return the links that none of them carries."""
        reached, waiting, roots = {WORLD}, [WORLD], []
        carried = {j.child for j in self.joints}
        for link in chain([""], (n for n in self.links if n not in carried), self.links):
            if link and link not in reached:
                roots.append(link)
                reached.add(link)
                waiting.append(link)
            while waiting:
                here = waiting.pop(0)
                for j in self.joints:
                    if j.parent == here and j.child not in reached:
                        reached.add(j.child)
                        waiting.append(j.child)
                        self.tree.append(j)
        return roots

    def _grow(self, link: str) -> None:
        """Add what a link carries, depth first."""
        for j in [j for j in self.tree if j.parent == link]:
            at = self.home[link]
            if j.kind != "fixed":
                at = self._add(at, MOVING[j.kind](*map(np.array, j.axes)), j.place, j.name)
                if self.model.joints[at].nv == 1:
                    what = f"damping of joint {j.name!r}"
                    self.model.damping[-1] = self._number(j.element, "axis/dynamics/damping", 0.0, what)
            self.home[j.child] = at
            self._carry(j.child)
            self._grow(j.child)

    def _add(self, parent: int, joint: Any, place: pin.SE3, name: str) -> int:
        number = int(self.model.addJoint(parent, joint, self.origins[parent].actInv(place), name))
        self.origins.append(place)
        return number

    def _carry(self, link: str) -> None:
        """Put a link's frame and inertia on the joint that carries it."""
        e, at, what = self.elements[link].find("inertial"), self.home[link], f"the inertial of {link!r}"
        self._frame(link, at, self.links[link], pin.FrameType.BODY)
        mass = self._number(e, "mass", 1.0, what)
        rows = [self._number(e, f"inertia/{k}", d, what) for k, d in
                zip(("ixx", "ixy", "iyy", "ixz", "iyz", "izz"), (1.0, 0, 1.0, 0, 0, 1.0), strict=True)]  # fmt: skip
        xx, xy, yy, xz, yz, zz = rows
        inertia = pin.Inertia(mass, np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        own = pin.SE3.Identity() if e is None else self._pose(e, f"{link}, its inertial")
        self.model.appendBodyToJoint(at, inertia, self.origins[at].actInv(self.links[link] * own))

    def _frame(self, name: str, joint: int, place: pin.SE3, kind: Any) -> None:
        self.model.addFrame(pin.Frame(name, joint, self.origins[joint].actInv(place), kind), False)

    def _carrier(self, e: ET.Element) -> int:
        """The joint that carries what a frame is attached to."""
        name, seen = e.get("attached_to", ""), set[str]()
        while name not in self.home and name in self.elements and name not in seen:
            seen.add(name)
            other = self.elements[name]
            name = (other.findtext("child") or "").strip() if other.tag == "joint" else other.get("attached_to", "")
        return self.home.get(name) or self.home[next(iter(self.links))]

    def _close(self, j: SdfJoint) -> Closure:
        names = (f"{j.name} on {j.parent}", f"{j.name} on {j.child}")
        for name, link in zip(names, (j.parent, j.child), strict=True):
            self._frame(name, self.home[link], j.place, pin.FrameType.OP_FRAME)
        axes = dict(zip(("axis", "second_axis"), j.axes, strict=False))
        return Closure(kind=CLOSED[j.kind], frames=names, name=j.name, **axes)  # type: ignore[arg-type]

    def _springs(self) -> Iterator[JointSpring]:
        for j in self.tree:
            k, rest = (self._number(j.element, f"axis/dynamics/spring_{key}", 0.0, f"the spring of {j.name!r}")
                       for key in ("stiffness", "reference"))  # fmt: skip
            if k:
                yield JointSpring(name=f"{j.name} spring", joint=j.name, stiffness=k, rest=rest)

    def _rubbing(self) -> list[str]:
        return [j.name for j in self.joints if self._number(j.element, "axis/dynamics/friction", 0.0, j.name)]

    def _visuals(self) -> tuple[pin.GeometryModel, list[str]]:
        """Solids; and the names of shapes of other kinds."""
        out, missing = pin.GeometryModel(), []
        for link in self.links:
            for e in self.elements[link].iterfind("visual"):
                name = f"{link}/{e.get('name', '')}"
                shape = self._shape(e.find("geometry"), name)
                if shape is None:
                    missing.append(name)
                    continue
                at = self.home[link]
                place = self.origins[at].actInv(self.links[link] * self._pose(e, name))
                geometry = pin.GeometryObject(name, at, place, shape)
                colour = e.findtext("material/diffuse")
                geometry.meshColor = np.array(self._numbers(colour, 4, name) if colour else [0.6, 0.6, 0.6, 1.0])
                out.addGeometryObject(geometry)
        return out, missing

    def _shape(self, e: ET.Element | None, name: str) -> Any:
        kind = None if e is None else next(iter(e), None)
        if kind is None:
            return None
        if kind.tag == "box":
            return coal.Box(*self._numbers(kind.findtext("size"), 3, name))
        r, length = (self._number(kind, key, 1.0, name) for key in ("radius", "length"))
        solids = {"sphere": lambda: coal.Sphere(r), "cylinder": lambda: coal.Cylinder(r, length),
                  "capsule": lambda: coal.Capsule(r, length)}  # fmt: skip
        return solids[kind.tag]() if kind.tag in solids else None
