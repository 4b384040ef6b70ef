"""SDF: links, joints and loops of one model, see sdformat.org.

SDF describes a graph of links. From the world, and from links without a parent joint, joints are added from parent to
child; a joint to a link that is already in the tree is cut and becomes a closure. If forces act along the axis of such
a joint, the link is split instead: its inertia is divided between both joints, and a weld connects the halves. Links
without a parent joint have a free joint, except in a static model.
"""

import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from ....errors import InputError
from ....file_io import read_text
from ...allowed_paths import AllowedPaths
from ...checked_table import Table
from ...closures.closure import Closure
from ...forces.joint_spring import JointSpring
from ...imported_model import EFFORTS, FRICTION, LIMITS, MIMICRY, ImportedModel, Mimic, name_list
from ...tree.frames import WORLD
from ...tree.joints import subspace
from ..body_tables import Source
from ..reader import KEY, Reader
from ..recorded import Recorded, unread_phrases
from .bodies import read_inertia, read_visuals
from .elements import SdfElements
from .joints import SdfAxis, SdfJoint, leaders, read_joint

CLOSURE_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "universal": "universal",
                 "ball": "point", "fixed": "frame"}  # fmt: skip


class SdfRecord(Table):
    """Record of an imported model, see `read_sdf`."""

    sdf: str
    folder: str
    packages: tuple[str, ...]


def read_sdf(text: str, name: str, allowed: AllowedPaths) -> ImportedModel:
    """Read an SDF text.

    Args:
        text: the SDF.
        name: name of the file, for messages.
        allowed: allowed paths of meshes.

    Raises:
        InputError: for a text that is not SDF with one model, or for unsupported contents, which it names.
    """
    root = Recorded.parse(text, name)
    worlds = root.all("world")
    models = [m for parent in (root, *worlds) for m in parent.all("model")]
    if root.tag != "sdf" or len(models) != 1:
        raise InputError(f"{name}: expected <sdf> with one <model>, got <{root.tag}> with {len(models)}")
    elements = SdfElements(models[0], root.get("version"), name)
    gravity = root.text("world/gravity")
    record = {"sdf": text, "folder": str(allowed.folder), "packages": list(map(str, allowed.packages))}
    return SdfModel(elements).imported_model(gravity, allowed, record, root)


class SdfModel:
    """The Pinocchio model built from the elements of an SDF file."""

    def __init__(self, elements: SdfElements) -> None:
        self.sdf = elements
        joints = [read_joint(elements, n, e) for n, e in elements.by_name.items() if e.tag == "joint"]
        self.static = elements.is_set(elements.model, "static")
        self.joints, self.static_joints = ([], joints) if self.static else (joints, [])
        self.inertias = {link: read_inertia(elements, link) for link in elements.links}
        self.model = pin.Model()
        self.model.name = elements.model.get("name", elements.file)
        self.parent_joints: dict[str, int] = {WORLD: 0}  # parent joints of links
        self.origins = [pin.SE3.Identity()]  # origins of joints in the world
        self.tree: list[SdfJoint] = []
        self.roots = self._choose_tree()
        self.split_joints = [j for j in self.joints if j not in self.tree and self._can_split(j)]
        self.splits = Counter(j.child for j in self.split_joints)

    def imported_model(self, gravity: str | None, allowed: AllowedPaths, record: dict, root: Recorded) -> ImportedModel:
        """Return the imported model of the file."""
        self._add_subtree(WORLD)
        for link in self.roots:
            placement = self.sdf.links[link]
            self.parent_joints[link] = (
                0 if self.static else self._add(0, pin.JointModelFreeFlyer(), placement, f"{link} free")
            )
            self._add_link(link)
            self._add_subtree(link)
        for name, e in self.sdf.by_name.items():
            if e.tag == "frame":
                self._frame(name, self.parent_joints[self.sdf.link_of(name) or WORLD], self.sdf.placement_of(name))
        closures = [self._close(j) for j in self.joints if j not in self.tree]
        visuals, shapeless, reason = read_visuals(
            self.sdf, allowed, lambda n: (self.parent_joints[n], self.origins[self.parent_joints[n]])
        )
        if reason:
            warnings.warn(f"{self.sdf.file}: meshes left out, {reason}", stacklevel=2)
        weightless = dict(filter(None, map(self._weightless, self.sdf.links)))
        springs, mimics = self._springs(), self._mimics()
        unsupported = [name_list(what, names) for what, names in self._unsupported(shapeless) if names]
        unread = chain(root.unread([self.sdf.model]), self.sdf.model.unread())
        return ImportedModel(
            self.model,
            visuals,
            record.copy,
            gravity=None if gravity is None else tuple(self.sdf.parse_numbers(gravity, 3, "gravity")),
            closures=tuple(closures),
            forces=tuple(springs),
            mimics=tuple(mimics),
            weightless=weightless,
            left_out=(*unsupported, *unread_phrases(unread)),
        )

    def _choose_tree(self) -> list[str]:
        """Choose the joints of the tree, breadth first from the world; return links without a parent joint in it."""
        reached, waiting, roots = {WORLD}, [WORLD], []
        children = {j.child for j in self.joints}
        for link in chain([""], (n for n in self.sdf.links if n not in children), self.sdf.links):
            if link and link not in reached:
                roots.append(link)
                reached.add(link)
                waiting.append(link)
            while waiting:
                parent = waiting.pop(0)
                for j in self.joints:
                    if j.parent == parent and j.child not in reached:
                        reached.add(j.child)
                        waiting.append(j.child)
                        self.tree.append(j)
        return roots

    def _can_split(self, j: SdfJoint) -> bool:
        """Return whether a loop-closing joint needs coordinates, and its child has inertia along its axes."""
        if not (j.has_force or j.mimic or j.name in leaders(self.joints)) or j.child == WORLD:
            return False
        placement, axes = j.placement.actInv(self.sdf.links[j.child]), np.reshape(subspace(j.model()), (6, -1))
        inertia = placement.act(self.inertias[j.child]).matrix()
        return bool(np.linalg.eigvalsh(axes.T @ inertia @ axes).min() > 0)

    def _add_subtree(self, link: str) -> None:
        """Add the subtree of a link, depth first."""
        for j in [j for j in self.tree if j.parent == link]:
            self.parent_joints[j.child] = self._add_joint(j)
            self._add_link(j.child)
            self._add_subtree(j.child)

    def _add_joint(self, j: SdfJoint) -> int:
        parent = self.parent_joints[j.parent]
        if j.kind == "fixed":
            return parent
        index = self._add(parent, j.model(), j.placement, j.name)
        j.copy_to(self.model, index)
        return index

    def _add(self, parent: int, joint: pin.JointModel, placement: pin.SE3, name: str) -> int:
        index = int(self.model.addJoint(parent, joint, self.origins[parent].actInv(placement), name))
        self.origins.append(placement)
        return index

    def _add_link(self, link: str) -> None:
        """Add the frame of a link, and its fraction of the inertia, to its parent joint."""
        self._frame(link, self.parent_joints[link], self.sdf.links[link], pin.FrameType.BODY)
        self._append_inertia(link, self.parent_joints[link])

    def _append_inertia(self, link: str, joint: int) -> None:
        inertia, fraction = self.inertias[link], 1 / (1 + self.splits[link])
        divided = pin.Inertia(inertia.mass * fraction, inertia.lever, inertia.inertia * fraction)
        self.model.appendBodyToJoint(joint, divided, self.origins[joint].actInv(self.sdf.links[link]))

    def _frame(self, name: str, joint: int, placement: pin.SE3, kind: pin.FrameType = pin.FrameType.OP_FRAME) -> None:
        self.model.addFrame(pin.Frame(name, joint, self.origins[joint].actInv(placement), kind), False)

    def _close(self, j: SdfJoint) -> Closure:
        names, is_split = (f"{j.name} on {j.parent}", f"{j.name} on {j.child}"), j in self.split_joints
        parents = [self.parent_joints[j.parent], self.parent_joints[j.child]]
        if is_split:
            parents[0] = self._add_joint(j)
            self._append_inertia(j.child, parents[0])
        for name, joint in zip(names, parents, strict=True):
            self._frame(name, joint, j.placement)
        axes = {} if is_split else dict(zip(("axis", "second_axis"), (a.xyz for a in j.axes), strict=False))
        kind = "frame" if is_split else CLOSURE_KINDS[j.kind]
        return Closure(kind=kind, frames=names, name=j.name, **axes)  # type: ignore[arg-type]

    def _weightless(self, link: str) -> tuple[str, float] | None:
        """Return the frame and mass of a link without weight."""
        if self.sdf.is_set(self.sdf.by_name[link], "gravity", True) or not self.parent_joints[link]:
            return None
        name, inertia = f"{link} centre of mass", self.inertias[link]
        self._frame(name, self.parent_joints[link], self.sdf.links[link] * pin.SE3(np.eye(3), inertia.lever))
        return name, inertia.mass

    @property
    def moving(self) -> list[SdfJoint]:
        """Joints that have coordinates."""
        return [j for j in (*self.tree, *self.split_joints) if j.kind != "fixed"]

    def _springs(self) -> list[JointSpring]:
        return [
            JointSpring(name=f"{j.name} spring", joint=j.name, stiffness=a.stiffness, rest=a.rest)
            for j in self.moving
            for a in j.axes
            if a.stiffness and j.scalar
        ]

    def _mimics(self) -> list[Mimic]:
        names = {j.name for j in self.moving}
        return [j.mimic for j in self.moving if j.mimic and j.mimic.other in names]

    def _unsupported(self, shapeless: list[str]) -> list[tuple[str, list[str]]]:
        """Return contents that are read, but not supported, with their names."""
        moving, cut = self.moving, [j for j in self.joints if j not in (*self.tree, *self.split_joints)]
        coupled, links = {m.joint for m in self._mimics()}, self.sdf.by_name

        def names(joints: Iterable[SdfJoint], has: Callable[[SdfAxis], Any]) -> list[str]:
            return [j.name for j in joints if any(map(has, j.axes))]

        has_limits, friction = attrgetter("has_limits"), attrgetter("friction")
        return [
            ("joints of a static model", [j.name for j in self.static_joints]),
            (LIMITS, names(moving, has_limits)),
            ("limits where loops are closed", names(cut, has_limits)),
            (EFFORTS, names(self.joints, attrgetter("has_bounds"))),
            (FRICTION, names(moving, friction)),
            ("friction where loops are closed", names(cut, friction)),
            ("springs of joints with two axes", names((j for j in moving if not j.scalar), attrgetter("stiffness"))),
            ("damping and springs where loops are closed", [j.name for j in cut if j.has_force]),
            (MIMICRY, [j.name for j in self.joints if j.unsupported_leader or (j.mimic and j.name not in coupled)]),
            ("kinematic motion of links", [n for n in self.sdf.links if self.sdf.is_set(links[n], "kinematic")]),
            ("shapes", shapeless),
        ]


def _read(path: Path, allowed: AllowedPaths, source: Source) -> ImportedModel:
    return read_sdf(read_text(path), path.name, allowed)


def _restored(record: Mapping[str, object], meshes: Sequence[Path] | None) -> ImportedModel:
    saved = SdfRecord.model_validate(record)
    return read_sdf(saved.sdf, "SDF", AllowedPaths.from_record(saved.folder, saved.packages, meshes))


sdf = Reader(
    "sdf",
    (".sdf",),
    _read,
    rejected={**KEY, "free_flyer": "does not belong to an SDF source: links of {} without a joint are free"},
    restore=_restored,
)
