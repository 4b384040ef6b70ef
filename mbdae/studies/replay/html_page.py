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
from .animation_tracks import TRACE, MovingDrawables, arrow_drawables, followable_bodies, path_clips, path_commands
from .surroundings import grid_spacing, ground_levels, surroundings
from .threejs import ROOT, animation_clips, draw_commands, node_path, pose_commands, quantized_geometry, typed_array

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Scene

COMPRESSION_LEVEL = 6  # 9 takes nine times as long for 3 % of a page with meshes
SCRIPTS = ("scene", "camera", "plots", "controls", "linkage", "sliders", "print")


class Extras(NamedTuple):
    """Contents of a scene besides the drawables of the mechanism.

    Attributes:
        moving: ghosts, and marks of switches.
        traces: paths, see `animation_tracks.traces`.
        forces: arrows, see `animation_tracks.arrows`.
        legend: colours and texts.
    """

    moving: Sequence[MovingDrawables] = ()
    traces: Sequence[Mapping[str, Any]] = ()
    forces: Mapping[str, Any] = {"largest": 0.0, "forces": ()}
    legend: Sequence[Mapping[str, str]] = ()


NO_EXTRAS = Extras()


def scene_data(
    scene: "Scene", model: object, shown: Sequence[Motion], times: Array, seen: Array, extras: Extras = NO_EXTRAS
) -> dict[str, Any]:
    """Return the data of a scene for the page.

    Args:
        scene: the scene, with lengths of rails and springs.
        model: the tree.
        shown: motions of the drawables.
        times: times of the frames in s, from 0, (m,).
        seen: configurations that should be visible, (n, nq).
        extras: further contents.
    """
    seen, bodies = sampled(seen), followable_bodies(scene, model)
    points = VisiblePoints(scene, seen)
    all_visible = points.visible()
    visible_with = {name: points.visible(k) for name, k in bodies.items()}
    heaviest, extent = next(iter(bodies), ""), all_visible.extent
    travels = bool(heaviest) and all_visible.moves and extent > FAR * visible_with[heaviest].extent
    solids: list[Solid] = []
    mechanism = MovingDrawables(drawables(scene), list(shown), ROOT)
    commands, clips = list(surroundings(extent)), []
    for drawn, motions, root in (mechanism, *extras.moving, arrow_drawables(extras.forces, extent)):
        commands += [*draw_commands(drawn, solids, root), *pose_commands(drawn, motions, root=root)]
        clips += animation_clips(drawn, motions, root)
    for trace in extras.traces:
        path = f"{ROOT}/trace/{trace['name'].replace('/', '|')}"
        commands += path_commands(path, trace["points"], trace["colour"], TRACE * extent)
        clips += path_clips(path, trace["points"], times)
    return {
        "geometries": [quantized_geometry(solid) for solid in solids],
        "commands": commands,
        "animations": clips,
        "times": typed_array(times, "float32"),
        "extent": extent,
        "flat": ("side", "front", "top", "3d")[all_visible.thin],
        "far": heaviest if travels else "",
        "cell": grid_spacing(extent),
        "levels": ground_levels(bounds(scene, seen), extent, scene.ground),
        "visible": {name: typed_array(x.points, "float32") for name, x in {"": all_visible, **visible_with}.items()},
        "bodies": [{"name": name, "path": node_path(mechanism.drawables[k].name)} for name, k in bodies.items()],
        "legend": list(extras.legend),
    }


def html_document(title: str, payload: Mapping[str, object]) -> str:
    """Return the page with a title and its data."""
    fields = {
        "title": html.escape(title),
        "style": _asset("replay.css"),
        "plotstyle": _asset("vendor/uPlot.min.css"),
        "script": _script(),
        "viewer": _viewer(),
        "plots": _plots(),
        "scene": _compressed(umsgpack.packb(payload)),
    }
    return re.sub(r"{{(\w+)}}", lambda match: fields[match[1]], _asset("replay.htm"))


def inline_frame(text: str, height: int = 520) -> str:
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
    """Return the script of the page, without comment lines."""
    scripts = [*(_asset(f"replay_{name}.js") for name in SCRIPTS), _asset("replay.js")]
    return re.sub(r"^ *//.*\n", "", "\n".join(scripts), flags=re.MULTILINE)


@cache
def _plots() -> str:
    return _compressed(_asset("vendor/uPlot.iife.min.js").encode())


def _compressed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, COMPRESSION_LEVEL, mtime=0)).decode("ascii")


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text("utf-8")
