"""A page with sliders over the poses of a mechanism, for inspection before a run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...data_types import JsonObject
from ...file_io import write_page
from ...mechanism import Mechanism, ModelSource
from ...mechanism.scene.drawables import drawables, motions
from ...mechanism.tree.frames import find_joint
from ...solution.problem import mechanism_of
from ...system import Array
from ...units import displayed, quantity
from ..replay import animation_tracks as tracks
from ..replay.html_page import html_document, inline_frame, scene_data
from ..replay.threejs import selectable_clips
from .linkage import linkage
from .sliders import MAX_SLIDERS, Slider, sliders

__all__ = ["view"]

ENDS = {
    "closed": "periodic",
    "range": "",
    "dead": "",
    "limits": "to the limits of the joint",
    "open": "the loops cannot be closed beyond",
}


@dataclass(frozen=True, eq=False)
class View:
    """Result of `view`: displayed in notebooks, and saved as one page.

    Attributes:
        mechanism: the mechanism.
        q: the pose at the start, (nq,).
        sliders: the independent coordinates, each with its poses.
    """

    mechanism: Mechanism
    q: Array
    sliders: tuple[Slider, ...]

    def __str__(self) -> str:
        head = f"{self.mechanism.title}, free coordinates: {len(self.sliders)}"
        rows = [f"  {s.joint}: {_range_text(s, '.6g')}" for s in self.sliders]
        return "\n".join([head, *rows])

    def to_dict(self) -> JsonObject:
        """Return ranges and dead points, without the poses."""
        return {
            "title": self.mechanism.title,
            "sliders": [
                {
                    "joint": s.joint,
                    "unit": s.unit,
                    "low": float(s.u.min()),
                    "high": float(s.u.max()),
                    "ended": s.ended,
                    "dead_points": list(s.dead_points),
                    "beyond": sorted({name for name in s.beyond if name}),
                }
                for s in self.sliders
            ],
        }

    def page(self) -> str:
        """Return the page as text."""
        start = self.q[None]
        reached = np.concatenate([start, *(s.q for s in self.sliders)])
        scene = self.mechanism.scene.for_motion(reached)
        linked = linkage(self.mechanism, scene, self.q, self.sliders) if len(self.sliders) > 1 else None
        at_start, by_joint = motions(scene, start), {s.joint: motions(scene, s.q) for s in self.sliders}
        payload = {
            **scene_data(scene, self.mechanism.model, at_start, np.zeros(1), reached),
            "choices": selectable_clips(drawables(scene), at_start, by_joint),
            "frames": 1,
            **{"start": 0.0, "end": 1.0, "speed": 1.0, "axis": {}},
            "gaps": tracks.closure_gaps(scene, reached),
            **{"camera": None, "follow": "", "marked": False, "ghosts": [], "panes": []},
            "sliders": [_slider_data(s) for s in self.sliders],
            "linkage": linked,
            "note": self._note(linked is not None),
        }
        return html_document(self.mechanism.title, payload)

    def _note(self, linked: bool) -> str:
        mech = self.mechanism
        several = [n for n in mech.joint_names if find_joint(mech.model, n).nv > 1]
        sentences = []
        if len(self.sliders) > 1:
            single = "One coordinate moves at a time, the others are at the model's start."
            together = "Coordinates keep their values; the page closes the loops."
            sentences = [together if linked else single]
        sentences += [f"Shown are {MAX_SLIDERS} coordinates."] if len(self.sliders) == MAX_SLIDERS else []
        sentences += [f"Not moved, joints of several coordinates: {', '.join(several)}."] if several else []
        sentences += ["Nothing can be moved."] if not self.sliders else []
        return " ".join(sentences)

    def save(self, path: str | Path) -> None:
        """Write the page.

        Raises:
            InputError: for another suffix or an unwritable path.
        """
        write_page(path, self.page, "a view")

    def _repr_html_(self) -> str:
        return inline_frame(self.page())


def view(mech: Mechanism | ModelSource, q: Array | None = None) -> View:
    """Compute the poses of a mechanism over each of its free coordinates.

    The poses cover the whole range in which the loops can be closed, through dead points of the coordinate, or the
    range between the limits of a joint outside all loops. Each of several coordinates covers the range from one dead
    point to the next; when they are moved together, the page closes the loops.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`; its drivers are released.
        q: the configuration, (nq,); the model's start when left out.

    Raises:
        AssemblyError: if the start of the model cannot be assembled.
        InputError: for a q of another length.

    Example:
        >>> mbdae.view(mbdae.load("four_bar")).save("four_bar.html")   # doctest: +SKIP
    """
    mech = mechanism_of(mech, "view")
    q = mech.start[0] if q is None else mech.vector("q", q, mech.nq)
    return View(mech, q, tuple(sliders(mech, q)))


def _slider_data(slider: Slider) -> dict[str, Any]:
    n = len(slider.u)
    dead = [float(np.abs(slider.u - d).argmin()) / (n - 1) for d in slider.dead_points]
    return {
        "joint": slider.joint,
        "unit": displayed(1.0, slider.unit)[1],
        "scale": displayed(1.0, slider.unit)[0],
        "u": slider.u.tolist(),
        "share": slider.start / (n - 1),
        "dead": dead,
        "description": _range_text(slider, ".4g"),
        "beyond": list(slider.beyond),
    }


def _range_text(slider: Slider, digits: str) -> str:
    low, high = displayed(slider.u.min(), slider.unit)[0], quantity(slider.u.max(), slider.unit, digits)
    dead = ", ".join(f"{displayed(d, slider.unit)[0]:.4g}" for d in slider.dead_points)
    remarks = [f"dead points at {dead} {displayed(0.0, slider.unit)[1]}" if dead else "", ENDS.get(slider.ended, "")]
    return "; ".join([f"{low:{digits}} to {high}", *filter(None, remarks)])
