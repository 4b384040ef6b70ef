"""Elements of an SDF model: numbers, relative poses, and the links to which frames are attached."""

import re
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from ....errors import InputError
from ...checked_table import HUGE
from ...tree.frames import WORLD
from ..recorded import Recorded

MODEL, MODEL_LABEL = "__model__", "the model"
YES = ("1", "true")
AXES_IN_MODEL = (1, 4)  # last version with axes in the model frame


class SdfElements:
    """The links, joints and frames of a model, by name.

    Attributes:
        file: name of the file, for messages.
        version: version of the format, two numbers; infinite if the file has none.
        model: the model element.
        by_name: elements of links, joints and frames.
        links: placement of each link in the world.
        canonical: link to which the frame of the model is attached.

    Raises:
        InputError: for nested models, missing or duplicate names, and invalid poses.
    """

    def __init__(self, model: Recorded, version: str, file: str) -> None:
        self.file, self.model = file, model
        found = re.fullmatch(r"\s*(\d{1,3})\.(\d{1,3}).*", version)
        self.version: tuple[float, ...] = tuple(map(int, found.groups())) if found else (np.inf,)
        if unread := [e.tag for e in model.children if e.tag in ("model", "include")]:
            raise InputError(f"{file}: <{unread[0]}> within a model is not read")
        self.by_name = {self._name(e): e for tag in ("link", "joint", "frame") for e in model.all(tag)}
        self.links = {n: self.placement_of(n) for n, e in self.by_name.items() if e.tag == "link"}
        self.canonical = model.get("canonical_link") or next(iter(self.links), WORLD)

    def _name(self, e: Recorded) -> str:
        name = e.get("name")
        if not name or sum(x.get("name") == name for x in self.model.all(e.tag)) > 1:
            raise InputError(f"{self.file}: each <{e.tag}> needs a different name, got {name!r}")
        return name

    def is_set(self, e: Recorded, path: str, default: bool = False) -> bool:
        """Read a flag."""
        text = e.text(path)
        return default if text is None else text.lower() in YES

    def placement_of(self, name: str, seen: tuple[str, ...] = ()) -> pin.SE3:
        """Return the placement of a link, joint or frame in the world."""
        if name in ("", MODEL):
            return self.pose(self.model, MODEL_LABEL)
        if name == WORLD:
            return pin.SE3.Identity()
        if name not in self.by_name or name in seen:
            raise InputError(f"{self.file}: {name!r} is not a link, joint or frame, or is placed relative to itself")
        e = self.by_name[name]
        base = e.get("attached_to") if e.tag == "frame" else (e.text("child") or "") if e.tag == "joint" else ""
        return self.placement_in_world(e, name, lambda: self.placement_of(base, (*seen, name)), (*seen, name))

    def placement_in_world(
        self, e: Recorded, name: str, base: pin.SE3 | Callable[[], pin.SE3], seen: tuple[str, ...] = ()
    ) -> pin.SE3:
        """Return the world placement of an element: its pose relative to the frame it names, or else to ``base``.

        Args:
            e: element, with or without a pose.
            name: name for messages.
            base: a placement, or a function without arguments that returns it.
            seen: names resolved so far.
        """
        pose = e.first("pose")
        other = pose.get("relative_to") if pose else ""
        reference = self.placement_of(other, seen) if other else base() if callable(base) else base
        return reference * self.pose(e, name)

    def pose(self, e: Recorded, name: str) -> pin.SE3:
        """Return the pose of an element, as written."""
        pose = e.first("pose")
        text = pose.text() if pose else ""
        if pose is None or not text:
            return pin.SE3.Identity()
        pose.skip_blank("frame")  # an attribute of versions 1.5 and 1.6, where a name has no defined meaning
        style, degrees = pose.get("rotation_format", "euler_rpy"), pose.get("degrees").lower() in YES
        if style not in ("euler_rpy", "quat_xyzw"):
            raise InputError(f"{self.file}: the pose of {name!r} is neither roll, pitch and yaw, nor a quaternion")
        x = np.array(self.parse_numbers(text, 7 if style == "quat_xyzw" else 6, f"the pose of {name!r}"))
        if style == "quat_xyzw":
            if not np.linalg.norm(x[3:]) > 0:
                raise InputError(f"{self.file}: the quaternion in the pose of {name!r} is zero")
            return pin.SE3(pin.Quaternion(x[3:] / np.linalg.norm(x[3:])).matrix(), x[:3])
        return pin.SE3(pin.rpy.rpyToMatrix(np.radians(x[3:]) if degrees else x[3:]), x[:3])

    def parse_numbers(self, text: str | None, n: int, context: str) -> list[float]:
        """Return ``n`` finite numbers.

        Raises:
            InputError: for any other text.
        """
        try:
            out = [float(x) for x in (text or "").split()]
        except ValueError:
            out = []
        if len(out) != n or not all(abs(x) <= HUGE for x in out):
            raise InputError(f"{self.file}: {context} takes {n} finite numbers, got {(text or '')[:60]!r}")
        return out

    def number(self, e: Recorded | None, path: str, default: float, context: str) -> float:
        """Return the number at a path; ``default`` if there is none."""
        text = None if e is None else e.text(path)
        return default if text is None else self.parse_numbers(text, 1, context)[0]

    def link_of(self, name: str) -> str | None:
        """Return the link, or the world, to which a link, frame or joint is attached; None if there is none."""
        seen = set[str]()
        while name not in (WORLD, *self.links):
            if name in ("", MODEL):
                name = self.canonical
                if name not in self.links:
                    return None
            elif name in seen or name not in self.by_name:
                return None
            else:
                seen.add(name)
                e = self.by_name[name]
                name = (e.text("child") or "-") if e.tag == "joint" else e.get("attached_to")
        return name
