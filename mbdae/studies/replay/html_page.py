"""The page that shows a scene: ``replay.htm`` with ``replay.css`` and the scripts ``replay*.js``.

Three gzipped blocks are unpacked by the browser: meshcat's viewer, uPlot, and the scene with its animation data.
"""

import base64
import gzip
import html
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import umsgpack

from ...errors import InputError
from .threejs import mesh_data, node, scene_object

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Scene, Shape

LEVEL = 6  # of compression: 9 takes nine times as long for 3 % of a page with meshes
SCRIPTS = ("scene", "springs", "camera", "plots", "controls", "linkage", "sliders", "print")


def scene_data(scene: "Scene", bodies: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """Return the data of a scene for the page, each mesh once, and the bodies that its camera can follow."""
    meshes = list(dict.fromkeys(shape.mesh for shape in scene.shapes if shape.mesh is not None))
    return {
        "meshes": [mesh_data(mesh) for mesh in meshes],
        "objects": [
            {"type": "set_object", "path": node(shape), "object": scene_object(shape, meshes, layer)}
            for shape, layer in _layers(scene)
        ],
        "width": scene.width,
        "ground": scene.ground,
        "bodies": list(bodies),
    }


def document(title: str, payload: Mapping[str, Any]) -> str:
    """Return the page with a title and its data."""
    filling = {
        "title": html.escape(title),
        "style": _asset("replay.css"),
        "plotstyle": _asset("vendor/uPlot.min.css"),
        "script": "\n".join([*(_asset(f"replay_{name}.js") for name in SCRIPTS), _asset("replay.js")]),
        "viewer": _viewer(),
        "plots": _plots(),
        "scene": _compressed(umsgpack.packb(payload)),
    }
    return re.sub(r"{{(\w+)}}", lambda key: filling[key[1]], _asset("replay.htm"))


def frame(text: str, height: int = 520) -> str:
    """Return a page as an inline frame for a notebook or another page."""
    style = f"width: 100%; height: {height}px; border: 0"
    return f'<iframe srcdoc="{html.escape(text)}" title="replay" style="{style}"></iframe>'


def _layers(scene: "Scene") -> Iterator[tuple["Shape", int]]:
    """Yield shapes and their layers; closures are drawn over everything else."""
    for k, shape in enumerate(scene.shapes):
        yield shape, len(scene.shapes) - k if shape.role == "closure" else 0


@cache
def _viewer() -> str:
    found = find_spec("meshcat")  # not imported: its server parts take a second
    if found is None or not found.submodule_search_locations:
        raise InputError(
            "a replay needs the viewer of the package 'meshcat', which is not installed: pip install meshcat"
        )
    return _compressed(Path(found.submodule_search_locations[0], "viewer", "dist", "main.min.js").read_bytes())


@cache
def _plots() -> str:
    return _compressed(_asset("vendor/uPlot.iife.min.js").encode())


def _compressed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, LEVEL, mtime=0)).decode("ascii")


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text("utf-8")
