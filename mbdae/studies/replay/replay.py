"""The replay: one HTML file that animates a solution next to its signals, offline and without a server."""

import html
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, UnknownNameError, is_number, require
from ...file_io import atomic_write, write_page
from ...mechanism.scene.drawables import drawables, motions
from ...mechanism.scene.visible import sampled
from ...units import quantity
from ..figures import COLOURS
from . import animation_tracks as tracks
from .html_page import Extras, html_document, inline_frame, scene_data
from .mode_tracks import mark_drawables, mode_legend, mode_tracks_of
from .plot_panels import Plot, PlotPanel, Signal, is_over_arclength, panes
from .threejs import selectable_clips, typed_array
from .video import VIDEO, film

__all__ = ["animate"]

if TYPE_CHECKING:
    from ...solution.solution import Solution

MIN_FRAMES = 101  # short runs are often viewed in slow motion
MAX_FRAMES = 6001  # unless fps is given: 100 s of viewing; the page interpolates between frames
VIEWING = 4.0  # s, duration of the slow motion of runs that are shorter than half of it
CAMERAS = ("front", "top", "side", "3d")
MAX_NOTEBOOK_TEXT = 20e6  # characters: larger pages make notebooks slow


def animate(
    sol: "Solution",
    path: str | Path,
    *,
    fps: float | None = None,
    speed: float | None = None,
    plots: str | Sequence[Plot] | None = None,
    signals: Mapping[str, Signal] | None = None,
    traces: str | Sequence[str] = (),
    ghosts: Mapping[str, "Solution"] | None = None,
    choices: Mapping[str, "Solution"] | None = None,
    arrows: bool | str | Sequence[str] = False,
    camera: str | None = None,
    follow: str | None = None,
    closures: bool = False,
    deformation: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write a solution as a self-contained HTML page for any browser, as a video, or as an animated scene.

    The page starts playing, and repeats; space, arrows, Home, End, L, < and > are its keys. Its script offers
    ``window.mbdae`` with ``seek(t)``, ``play()``, ``pause()``, ``t``, ``start``, ``duration``, ``speed``, ``loop`` and
    ``viewer``. The address sets its state: ``run.html#t=1.5&speed=0.1&camera=front&plots=0``, also ``follow=BODY``,
    ``closures=1``, ``autoplay=0``, ``loop=0`` and ``shadows=0``; with a time it is paused.

    Args:
        sol: the solution; shown from its first to its last time.
        path: the file; ``.html``, ``.mp4`` or ``.gif`` for a video, which needs Chromium, or ``.glb``: bodies, springs,
            sticking joints, active contacts and impacts as a glTF file for slides and Blender. An existing file is
            replaced atomically.
        fps: frames stored per second of viewing; 60, fewer beyond 100 s, in videos 30 (.mp4) and 20 (.gif), when
            left out.
        speed: seconds of motion per second of viewing; below 1 is slow motion. When left out 1, or less for motions
            shorter than two seconds.
        plots: curves next to the scene, each a name of `Solution.signals` (``"q.crank"``), the beginning of
            several (``"q"``, ``"lam.wrist pin"``), or a list of both for common axes. Joint coordinates, energies
            and |g| when left out; () for none.
        signals: additional signals by name: functions of (t, q, v), or arrays over ``sol.t``.
        traces: names of frames whose paths are drawn; ``contact.<closure>`` is a contact point.
        ghosts: further solutions with the same joints by name, drawn translucent in the scene and dashed in the plots;
            impacts and sticking are marked for ``sol`` alone.
        choices: solutions of this mechanism by name, of which the page shows the selected one; the first replaces
            ``sol``.
        arrows: names of closures and joints whose forces on the body of their second frame, or on the child body, are
            drawn as arrows; True for all closures between frames. For redundant rows, those of minimum norm.
        camera: ``"front"`` (along y), ``"top"`` or ``"side"`` (along x), without perspective, or ``"3d"``; when left
            out normal to the plane of a planar motion, else 3d.
        follow: a joint whose body the camera follows, ``""`` for none; when left out the heaviest one if the
            mechanism travels far.
        closures: whether all closures are marked; otherwise only closures with a visible gap.
        deformation: factor on the deflections of flexible bodies in the scene; 1 when left out.
        progress: called with the finished fraction of a video.

    Returns:
        The path written.

    Raises:
        UnknownNameError: for a signal, frame or closure that does not exist; lists those that do.
        InputError: for an empty or nonfinite solution, an ``fps`` or ``speed`` that is not positive, a ``deformation``
            that is not finite, a ghost of another mechanism, an unwritable file, or missing programs for a video.
    """
    suffix = Path(path).suffix
    if suffix == ".glb":
        from .glb import glb

        _check_arguments(sol, fps, speed, deformation)
        times, q = _frames(sol, 30.0 if fps is None else fps, MAX_FRAMES)
        with atomic_write(path) as draft:
            scene = sol.mechanism.scene.with_scaled_deformation(deformation).for_motion(q)
            marks = mode_tracks_of(sol, q)
            draft.write_bytes(glb(scene, times, q, sol.mechanism.title, speed or playback_speed(sol), marks))
        return Path(path)
    shown: dict[str, Any] = {"plots": plots, "signals": signals, "traces": traces, "ghosts": ghosts, "arrows": arrows}
    shown |= {"choices": choices, "camera": camera, "follow": follow, "closures": closures, "deformation": deformation}
    if suffix in VIDEO:
        rate = VIDEO[suffix].fps if fps is None else fps
        speed = playback_speed(sol) if speed is None else speed
        film(page(sol, fps=rate, speed=speed, **shown), Path(path), rate, abs(sol.t[-1] - sol.t[0]) / speed, progress)
        return Path(path)
    if suffix != ".html":
        raise InputError(f"a replay is written as .html, .mp4, .gif or .glb, got {str(path)!r}")
    write_page(path, lambda: page(sol, fps=fps, speed=speed, **shown), "a replay")
    return Path(path)


def page(
    sol: "Solution",
    *,
    fps: float | None = None,
    speed: float | None = None,
    plots: str | Sequence[Plot] | None = None,
    signals: Mapping[str, Signal] | None = None,
    traces: str | Sequence[str] = (),
    ghosts: Mapping[str, "Solution"] | None = None,
    choices: Mapping[str, "Solution"] | None = None,
    arrows: bool | str | Sequence[str] = False,
    camera: str | None = None,
    follow: str | None = None,
    closures: bool = False,
    deformation: float | None = None,
) -> str:
    """Return the page that `animate` writes.

    Raises:
        InputError: as `animate`.
    """
    _check_arguments(sol, fps, speed, deformation)
    mechanism, ghosts, choices = sol.mechanism, ghosts or {}, choices or {}
    _check_solutions("ghost", ghosts)
    _check_solutions("choice", choices)
    require(signals, Mapping | None, "signals are functions or arrays by name")
    speed = playback_speed(sol) if speed is None else speed
    if camera is not None:
        _check_known("camera", camera, CAMERAS)
    times, q = _frames(sol, 60.0 / speed if fps is None else fps / speed, MAX_FRAMES if fps is None else None)
    bent = mechanism.scene.with_scaled_deformation(deformation)
    scene = bent.for_motion(q)
    if follow:
        _check_known("body", follow, list(tracks.followable_bodies(scene, mechanism.model)))
    shown, offsets = motions(scene, q), np.abs(times - times[0])
    selectable = dict(tracks.choices(sol, scene, choices, times))
    drawn_ghosts = tracks.ghosts(sol, bent, ghosts, times)
    marks = [] if choices else mode_tracks_of(sol, q)
    forces = tracks.arrows(sol, arrows, times, deformation)

    def configurations(t: np.ndarray) -> np.ndarray:
        return q if t is times else sol(t)[0]

    paths = tracks.traces(mechanism, traces, configurations, times, deformation)
    extras = Extras(
        [*(moving for _, _, moving in drawn_ghosts), mark_drawables(marks, times, speed, scene.width)],
        paths,
        forces,
        [*_legend(drawn_ghosts, paths, forces), *mode_legend(marks)],
    )
    choice_motions = {name: found for name, (found, _) in selectable.items()}
    seen = np.concatenate([sampled(q), *(sampled(x) for _, x in selectable.values())])
    payload = {
        **scene_data(scene, mechanism.model, shown, offsets, seen, extras),
        "choices": selectable_clips(drawables(scene), shown, choice_motions, offsets),
        "frames": len(times),
        "start": float(times[0]),
        "end": float(times[-1]),
        "speed": float(speed),
        "axis": _axis(sol),
        "gaps": tracks.closure_gaps(scene, q),
        "camera": camera,
        "follow": follow,
        "marked": closures,
        "ghosts": [{"name": name, "colour": colour} for name, colour, _ in drawn_ghosts],
        "panes": [_pane(p) for p in panes(sol, plots, signals or {}, ghosts.values())],
    }
    return html_document(mechanism.title, payload)


def _legend(
    ghosts: Sequence[tuple[str, str, Any]], paths: Sequence[Mapping[str, Any]], forces: Mapping[str, Any]
) -> list[dict[str, str]]:
    """Return colours and texts of ghosts, paths and forces."""
    out = [{"colour": colour, "text": name} for name, colour, _ in ghosts]
    out += [{"colour": path["colour"], "text": f"path of {path['name']}"} for path in paths]
    for k, force in enumerate(forces["forces"]):
        longest = "" if k else f", longest {quantity(forces['largest'], 'N', '.3g')}"
        out.append({"colour": force["colour"], "text": f"force of {force['name']}{longest}"})
    return out


def _check_arguments(sol: object, fps: float | None, speed: float | None, deformation: float | None) -> None:
    if not hasattr(sol, "mechanism"):
        raise InputError(f"animate takes a Solution (see mbdae.solve), got {sol!r:.60}")
    for name, value in (("fps", fps), ("speed", speed)):
        if value is not None and not (is_number(value) and value > 0):
            raise InputError(f"{name} must be a positive number, not {value!r:.60}")
    if deformation is not None and not is_number(deformation):
        raise InputError(f"deformation is a factor, a finite number, not {deformation!r:.60}")


def _check_solutions(kind: str, table: Mapping[str, object]) -> None:
    require(table, Mapping, f"{kind}s are solutions by name")
    for name, sol in table.items():
        if not hasattr(sol, "mechanism"):
            raise InputError(f"{kind} {name!r} is a Solution (see mbdae.solve), got {sol!r:.60}")


def _check_known(kind: str, name: str, known: Sequence[str]) -> None:
    if name not in known:
        raise UnknownNameError(kind, name, known)


def playback_speed(sol: "Solution") -> float:
    """Return seconds of motion per second of viewing: 1, or for a short motion 1, 2 or 5 times a power of ten."""
    span = abs(float(sol.t[-1] - sol.t[0])) if len(sol.t) else 0.0
    if not 0 < span < VIEWING / 2:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(span / VIEWING))
    return float(f"{max(k * decade for k in (1, 2, 5) if k * decade <= 1.001 * span / VIEWING):.1g}")


def notebook(sol: "Solution") -> str:
    """Return the replay of a solution for a notebook; a line of text if it would be too large."""
    text = page(sol, fps=30.0)
    if len(text) > MAX_NOTEBOOK_TEXT:
        size = f"{len(text) / 1e6:.0f} MB"
        return f"<p>{html.escape(repr(sol))}<br>The replay has {size}: mbdae.animate(sol, 'run.html') writes it.</p>"
    return inline_frame(text)


def _frames(sol: "Solution", rate: float, max_frames: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Return uniform times (m,), at most ``max_frames``, and the configurations (m, nq) at these times."""
    if len(sol.t) == 0:
        raise InputError("the solution is empty: there is no motion to show")
    if len(sol.t) == 1:
        times, q = np.asarray(sol.t, dtype=float), np.asarray(sol.q, dtype=float)
    else:
        start, end = float(sol.t[0]), float(sol.t[-1])
        count = max(MIN_FRAMES, int(np.ceil(abs(end - start) * rate)) + 1)
        times = np.linspace(start, end, min(count, max_frames or count))
        q = sol(times)[0]
    nonfinite = ~np.isfinite(q).all(axis=1)
    if nonfinite.any():
        raise InputError(f"the solution is not finite at t = {times[nonfinite.argmax()]:g}")
    return times, q


def _axis(sol: "Solution") -> dict[str, str]:
    """Return the name of the independent variable, and the texts before and after its values."""
    if is_over_arclength(sol):
        return {"name": "arclength", "clock": "arclength s = ", "tick": "s = ", "unit": ""}
    return {"name": "time", "clock": "t = ", "tick": "", "unit": " s"}


def _pane(pane: PlotPanel) -> dict[str, Any]:
    curves = [
        {
            "name": {"g": "|g|", "Gv": "|G v|"}.get(c.name, c.name),
            "ghost": c.ghost,
            "t": typed_array(c.t, "float64"),
            "y": typed_array(c.y, "float32"),
        }
        for c in pane.curves
    ]
    shared = {"title": pane.title, "logarithmic": pane.logarithmic, "cut": pane.cut}
    return {**shared, "colours": COLOURS, "curves": curves}
