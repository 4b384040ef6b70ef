"""The sub-command ``animate``."""

from pathlib import Path
from typing import Any

import click

from ...cli.options import REPLAY
from ...cli.output import PAGES, VIDEOS, output_file
from ...cli.study_command import Output, Study, command
from ...cli.values import panels
from ...errors import InputError
from ...progress import progress_bar

RUNS = click.argument("solutions", nargs=-1, required=True, metavar="RUN.npz [OTHER.npz...]")
FILES = (
    output_file("-o", "--output", suffixes=PAGES, help="The HTML page to write."),
    output_file("--video", suffixes=VIDEOS, help="The video to write, .mp4 or .gif; needs Chromium."),
    output_file("--glb", suffixes=(".glb",), help="The animated scene to write, for slides and Blender."),
)
MORE = (
    click.option("--plots", multiple=True, help="A signal, q.crank, or several on common axes: q.crank,q.rod."),
    click.option(
        "--meshes",
        multiple=True,
        type=click.Path(exists=True, file_okay=False),
        help="A folder for meshes, besides the folders of the runs and installed packages.",
    ),
)


@command("", *FILES, shared=f"{REPLAY} units", subject=RUNS, more=MORE)
def animate(
    study: Study,
    out: Output,
    solutions: tuple[str, ...],
    plots: tuple[str, ...],
    meshes: tuple[str, ...],
    arrows: tuple[str, ...],
    every: bool,
    **options: Any,
) -> None:
    """Write the replay of saved runs as a page or a video. Runs after the first one are shown as ghosts."""
    from ...solution.solution import Solution

    if not out.written:
        raise InputError("animate writes a page, -o run.html, a video, --video run.mp4, or a scene, --glb run.glb")
    sol, *others = (Solution.load(name, meshes=meshes) for name in solutions)
    stems = [Path(name).stem for name in solutions[1:]]
    names = stems if len(set(stems)) == len(stems) else solutions[1:]
    ghosts = dict(zip(names, others, strict=True))
    with progress_bar("animate", 1.0) as report_progress:
        for path in out.written:
            study(
                sol,
                path,
                plots=panels(plots),
                ghosts=ghosts,
                arrows=every or arrows,
                progress=report_progress,
                **options,
            )
    out.emit({}, "")
