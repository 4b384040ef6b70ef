"""loop_closures.yaml next to a URDF: the hinges that CAD exporters cut to obtain a tree.

================================  ======================================================================
closures: [{link_a, link_b,       a hinge between two links: a point on it in m, and its direction, both in
            point, axis}]         the axes of the base link with all joints at zero
independent: [joint]              actuated joints: named inputs
dependent: [joint]                joints determined by the closures
================================  ======================================================================
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from pydantic import ValidationError

from ....discovery import lazy_import
from ....errors import InputError
from ....file_io import read_text
from ...allowed_paths import AllowedPaths, access_error
from ...checked_table import Table, one_line
from ...closures.closure import Axis, Closure
from ...imported_model import ImportedModel
from ...model_settings import Motor
from ...tree.frames import find_joint, frame_placement
from ...tree.pinocchio_data import make_data
from ..body_tables import Frame, Vector

yaml_table = lazy_import("mbdae.mechanism.formats.yaml_table", "yaml_table")  # imports a reader of YAML
FILE, BASE = "loop_closures.yaml", "base_link"


class CutHinge(Table):
    """A hinge that was cut to obtain a tree."""

    link_a: str
    link_b: str
    point: Vector
    axis: Axis


class CutLoops(Table):
    """Valid entries of a loop_closures.yaml."""

    closures: tuple[CutHinge, ...] = ()
    dependent: tuple[str, ...] = ()
    independent: tuple[str, ...] = ()


def add_loop_closures(imported: ImportedModel, path: Path, allowed: AllowedPaths) -> ImportedModel:
    """Add the closures of a loop_closures.yaml next to a URDF, or in the package above its folder ``urdf``.

    Raises:
        InputError: for invalid contents; the message names the key and the expected value.
        UnknownNameError: for an unknown link or joint.
    """
    package = path.parent.parent
    in_package = (package / FILE, package / "config" / FILE) if path.parent.name == "urdf" else ()
    candidates = [path.parent / FILE, *in_package]
    found = next((file for file in candidates if file.is_file()), None)
    if found is None:
        return imported
    if not allowed.allows(found):
        raise access_error(FILE, found.resolve(), allowed.root)
    content: Any = yaml_table(read_text(found), FILE)
    try:
        loops = CutLoops.model_validate(content)
    except ValidationError as e:
        raise InputError(f"{FILE}: {one_line(e, lambda hinge: list(CutLoops.model_fields), content)}") from None
    model = imported.model
    for name in (*loops.independent, *loops.dependent):
        find_joint(model, name)
    data = make_data(model)
    pin.forwardKinematics(model, data, pin.neutral(model))
    frames, closures = [*imported.frames], [*imported.closures]
    for i, cut in enumerate(loops.closures, 1):
        hinge = frame_placement(model, data, _base(model)) * pin.SE3(np.eye(3), np.array(cut.point))
        names = tuple(f"loop {i} on {link}" for link in (cut.link_a, cut.link_b))
        for name, link in zip(names, (cut.link_a, cut.link_b), strict=True):
            relative = frame_placement(model, data, link).actInv(hinge)
            xyz, rpy = relative.translation.tolist(), pin.rpy.matrixToRpy(relative.rotation).tolist()
            frames.append(Frame(name=name, parent=link, xyz=xyz, rpy=rpy))
        closures.append(Closure(kind="revolute", name=f"loop {i}", frames=names, axis=cut.axis))
    motors = tuple(Motor(n, n) for n in loops.independent)
    return replace(imported, frames=tuple(frames), closures=tuple(closures), motors=motors)


def _base(model: pin.Model) -> str:
    """Return the base link, or the first link if there is no base link."""
    links = [f.name for f in model.frames if f.type == pin.FrameType.BODY and f.name != "universe"]
    return BASE if BASE in links else links[0]
