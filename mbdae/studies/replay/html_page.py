"""The page that shows a scene: ``replay.htm`` with ``replay.css`` and the scripts ``replay*.js``.

Three gzipped blocks are unpacked by the browser: meshcat's viewer, uPlot, and the scene with its animation data.
"""

import base64
import gzip
import html
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import umsgpack

from ...errors import InputError
from ...mechanism.scene.drawables import Motion, Solid, drawables
from ...mechanism.scene.visible import FAR, VisiblePoints, bounds, sampled
from ...system import Array
from . import animation_tracks as tracks
from .animation_tracks import Moving, drawn_path, drawn_so_far
from .stage import cell, levels, stage
from .threejs import ROOT, animations, drawn, node, packed, placed, typed

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Scene

LEVEL = 6  # of compression: 9 takes nine times as long for 3 % of a page with meshes
SCRIPTS = ("scene", "camera", "plots", "controls", "linkage", "sliders", "print")


class Extra(NamedTuple):
    """Contents of a page besides the drawables of its scene."""

    moving: Sequence[Moving] = ()
    traces: Sequence[Mapping[str, Any]] = ()
    forces: Mapping[str, Any] = {"largest": 0.0, "forces": ()}
    legend: Sequence[Mapping[str, str]] = ()


NO_EXTRAS = Extra()


def scene_data(
    scene: "Scene", model: object, shown: Sequence[Motion], times: Array, seen: Array, extra: Extra = NO_EXTRAS
) -> dict[str, Any]:
    """Return the data of a scene for the page.

    Args:
        scene: the scene, with lengths of rails and springs.
        model: the tree.
        shown: motions of its parts.
        times: of their frames, from 0 in s, (m,).
        seen: configurations that should be visible, (n, nq).
        extra: other moving parts, paths and forces.
    """
    motion_points, bodies = VisiblePoints(scene, sampled(seen)), tracks.bodies(scene, model)
    whole = motion_points.visible()
    near = {name: motion_points.visible(k) for name, k in bodies.items()}
    first = next(iter(near), "")
    far = bool(first) and whole.moves and whole.extent > FAR * near[first].extent
    solids: list[Solid] = []
    own = tracks.Moving(drawables(scene), list(shown), ROOT)
    all_moving = [own, *extra.moving, tracks.drawn_arrows(extra.forces, whole.extent)]
    commands = list(stage(whole.extent))
    for moving in all_moving:
        commands += [*drawn(moving.parts, solids, moving.root), *placed(*moving[:2], root=moving.root)]
    clips = [x for moving in all_moving for x in animations(*moving[:2], moving.root)]
    for trace in extra.traces:
        path = f"{ROOT}/trace/{trace['name'].replace('/', '|')}"
        commands += drawn_path(path, trace["points"], trace["colour"], tracks.TRACE * whole.extent)
        clips += drawn_so_far(path, trace["points"], times)
    return {
        "geometries": [packed(solid) for solid in solids],
        "commands": commands,
        "animations": clips,
        "times": typed(times, "float32"),
        "extent": whole.extent,
        "flat": ("side", "front", "top", "3d")[whole.thin],
        "far": first if far else "",
        "cell": cell(whole.extent),
        "levels": levels(bounds(scene, sampled(seen)), whole.extent, scene.ground),
        "visible": {name: typed(x.points, "float32") for name, x in {"": whole, **near}.items()},
        "bodies": [{"name": name, "path": node(own.parts[k].name)} for name, k in bodies.items()],
        "legend": list(extra.legend),
    }


def document(title: str, payload: Mapping[str, object]) -> str:
    """Return the page with a title and its data."""
    filling = {
        "title": html.escape(title),
        "style": _asset("replay.css"),
        "plotstyle": _asset("vendor/uPlot.min.css"),
        "script": _script(),
        "viewer": _viewer(),
        "plots": _plots(),
        "scene": _compressed(umsgpack.packb(payload)),
    }
    return re.sub(r"{{(\w+)}}", lambda key: filling[key[1]], _asset("replay.htm"))


def frame(text: str, height: int = 520) -> str:
    """Return a page as an inline frame for a notebook or another page."""
    style = f"width: 100%; height: {height}px; border: 0"
    return f'<iframe srcdoc="{html.escape(text)}" title="replay" style="{style}"></iframe>'


def viewer_folder() -> Path:
    """Return the folder with meshcat's page and script.

    Raises:
        InputError: if meshcat is not installed.
    """
    found = find_spec("meshcat")  # not imported: its server parts take a second
    if found is None or not found.submodule_search_locations:
        raise InputError(
            "a replay needs the viewer of the package 'meshcat', which is not installed: pip install meshcat"
        )
    return Path(found.submodule_search_locations[0], "viewer", "dist")


@cache
def _viewer() -> str:
    return _compressed((viewer_folder() / "main.min.js").read_bytes())


@cache
def _script() -> str:
    """Return the page's own script without lines of comments, which its readers find in mbdae."""
    parts = [*(_asset(f"replay_{name}.js") for name in SCRIPTS), _asset("replay.js")]
    return re.sub(r"^ *//.*\n", "", "\n".join(parts), flags=re.MULTILINE)


@cache
def _plots() -> str:
    return _compressed(_asset("vendor/uPlot.iife.min.js").encode())


def _compressed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, LEVEL, mtime=0)).decode("ascii")


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text("utf-8")
