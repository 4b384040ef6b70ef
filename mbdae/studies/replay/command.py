"""The sub-command ``animate``."""

from pathlib import Path
from typing import Any

import click

from ...cli.options import (
    PAGES,
    as_json,
    bar,
    emit,
    panels,
    replay_options,
    writable,
)
from ...errors import InputError


@click.command()
@click.argument("solutions", nargs=-1, required=True, metavar="RUN.npz [OTHER.npz...]")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="The HTML page to write.")
@click.option("--video", type=click.Path(dir_okay=False), help="The video to write, .mp4 or .gif; takes Chromium.")
@click.option("--plots", multiple=True, help="A signal, q.crank, or several on common axes: q.crank,q.rod.")
@click.option("--glb", type=click.Path(dir_okay=False), help="The animated scene to write, for slides and Blender.")
@click.option(
    "--meshes",
    multiple=True,
    type=click.Path(exists=True, file_okay=False),
    help="A folder from which meshes are read, beside those below the runs' own folders and of installed packages.",
)
@replay_options
@as_json
def animate(
    solutions: tuple[str, ...],
    output: str | None,
    video: str | None,
    plots: tuple[str, ...],
    arrows: tuple[str, ...],
    every: bool,
    glb: str | None,
    meshes: tuple[str, ...],
    as_json: bool,
    **options: Any,
) -> None:
    """Write the replay of a saved solution as one HTML page or as a video; further solutions are shown as ghosts."""
    from ...solution.solution import Solution
    from .replay import animate as write
    from .video import VIDEO

    written = writable((output, PAGES), (video, tuple(VIDEO)), (glb, (".glb",)))
    if not written:
        raise InputError("animate writes a page, -o run.html, a video, --video run.mp4, or a scene, --glb run.glb")
    sol, *others = (Solution.load(name, meshes=meshes) for name in solutions)
    stems = [Path(name).stem for name in solutions[1:]]
    names = stems if len(set(stems)) == len(stems) else solutions[1:]
    with bar("animate", 1.0) as tell:
        for path in written:
            ghosts = dict(zip(names, others, strict=True))
            write(sol, path, plots=panels(plots), ghosts=ghosts, arrows=every or arrows, progress=tell, **options)
    emit({"written": written}, "\n".join(f"wrote {path}" for path in written), as_json)
