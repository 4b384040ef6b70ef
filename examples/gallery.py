"""The pictures of the pages: replays, and figures of studies.

Everything is drawn by mbdae itself: a browser without a window draws the replay pages, matplotlib the figures. Run it
to make them anew after a change; it takes some minutes.
"""

from collections.abc import Sequence
from pathlib import Path

from PIL import Image

import mbdae
from mbdae.studies import figures
from mbdae.studies.drift.figure import drifts
from mbdae.studies.replay import video
from mbdae.studies.replay.replay import page

REPLAYS = {  # model: end (s), share of it that is shown
    "slider_crank": (2.0, 0.6),
    "four_bar": (2.0, 0.55),
    "andrews_squeezer": (0.03, 0.4),
    "panda_handle": (5.0, 0.44),
    "dual_arm": (1.0, 0.5),
    "humanoid_stance": (0.5, 0.5),
}
METHODS = ("herk3", "herk5", "pherk5", "pherk6", "radau5", "ggl:pherk5", "index1:dop853")
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
FOLDER = Path(__file__).parent / "pictures"


def main(folder: Path = FOLDER) -> dict[str, int]:
    """Draw all pictures into a folder; returns their sizes in bytes."""
    replays(folder)
    replay_page(folder)
    work_precision(folder)
    convergence(folder)
    drift(folder)
    return {path.name: path.stat().st_size for path in sorted(folder.glob("*.png"))}


def replays(folder: Path, names: Sequence[str] = tuple(REPLAYS)) -> None:
    """Scenes of models side by side, three in a row."""
    tiles = [replay(name, *REPLAYS[name]) for name in names]
    width, height = tiles[0].size
    sheet = Image.new("RGB", (3 * width, -(-len(tiles) // 3) * height), "white")
    for k, tile in enumerate(tiles):
        sheet.paste(tile, (k % 3 * width, k // 3 * height))
    small(sheet, folder / "replays.png")


def replay(name: str, end: float, share: float) -> Image.Image:
    """The scene of a model's replay, without plots."""
    mech = mbdae.load(name)
    sol = mbdae.solve(mech, (0, end), rtol=1e-6)
    return video.still(page(sol, plots=(), fps=30 * min(1.0, end)), share, (400, 260))


def replay_page(folder: Path) -> None:
    """A replay page as a whole: two solutions, the path of a point, the force in a joint, and signals."""
    mech = mbdae.load("slider_crank")
    sol = mbdae.solve(mech, (0, 5), rtol=1e-8)
    coarse = mbdae.solve(mech, (0, 5), method="herk1", step=0.01)
    text = page(sol, traces=["rod_tip"], ghosts={"herk1, h = 0.01 s": coarse}, arrows=["wrist pin"])
    small(video.still(text, 0.74, (1200, 675)), folder / "replay_page.png")


def work_precision(
    folder: Path, end: float = 5.0, methods: Sequence[str] = METHODS, tolerances: Sequence[float] = TOLERANCES
) -> None:
    """Errors of methods over linear solves and over time."""
    result = mbdae.compare(mbdae.load("four_bar"), (0, end), methods=methods, rtol=tolerances)
    result.plot(folder / "work_precision.png")
    reduce(folder / "work_precision.png")


def convergence(folder: Path, methods: Sequence[str] = ("herk3", "herk5", "pherk5", "rk4")) -> None:
    """Observed and claimed orders."""
    mbdae.check_order(mbdae.load("four_bar"), methods=methods).plot(folder / "convergence.png")
    reduce(folder / "convergence.png")


def drift(folder: Path, end: float = 10.0, methods: Sequence[str] = ("herk3", "herk5", "pherk5")) -> None:
    """Drift of the closures and of the energy, with and without projection."""
    mech = mbdae.load("four_bar")
    runs = [mbdae.solve(mech, (0, end), method=name, rtol=1e-6, project=False) for name in methods]
    runs.append(mbdae.solve(mech, (0, end), rtol=1e-6, project=True))
    figures.save(drifts([mbdae.drift(sol).history for sol in runs]), folder / "drift.png")
    reduce(folder / "drift.png")


def reduce(path: Path) -> None:
    """Write a picture anew with few colours."""
    with Image.open(path) as image:
        small(image.convert("RGB"), path)


def small(image: Image.Image, path: Path) -> None:
    """Write a picture with a palette of its own."""
    image.quantize(256, kmeans=2).save(path, optimize=True)


if __name__ == "__main__":
    for name, size in main().items():
        print(f"{name:24}{size / 1000:8.1f} kB")
