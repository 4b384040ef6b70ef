"""The pictures of the pages: replays, and figures of studies.

Everything is drawn by mbdae: a headless browser draws the replay pages, matplotlib the figures. Run it after a change
of the code that draws them; it takes some minutes. Each picture contains a digest of the code that drew it (style
sheets and scripts as they are, Python without docstrings and comments), by which a test finds outdated ones.
"""

import hashlib
import io
import tokenize
from collections.abc import Iterable, Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from PIL import Image, PngImagePlugin

import mbdae
from mbdae.studies import figures
from mbdae.studies.drift.figure import drifts
from mbdae.studies.replay import video
from mbdae.studies.replay.replay import page
from mbdae.studies.tolerance.figure import band

REPLAYS = {  # model: end (s), fraction of it that is shown
    "slider_crank": (2.0, 0.6),
    "four_bar": (2.0, 0.55),
    "andrews_squeezer": (0.03, 0.4),
    "panda_handle": (5.0, 0.44),
    "dual_arm": (1.0, 0.5),
    "humanoid_stance": (0.5, 0.5),
}
METHODS = ("herk3", "herk5", "pherk5", "pherk6", "radau5", "ggl:pherk5", "index1:dop853")
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
EXAMPLES, PACKAGE = Path(__file__).parent, Path(mbdae.__file__).parent
FOLDER = EXAMPLES / "pictures"
KEY = "drawn by"
COLOURS = 128
REPLAY = ("studies/replay/*.[jch]*", "studies/replay/*.py", "mechanism/scene/*.py")
FIGURE = ("studies/figures.py", "studies/{}/figure.py")
SOURCES = {  # patterns of the files that draw a picture; work_precision_peers.png belongs to the benchmark
    "replays.png": [PACKAGE / x for x in REPLAY],
    "replay_page.png": [PACKAGE / x for x in REPLAY],
    "work_precision.png": [PACKAGE / x.format("comparison") for x in FIGURE],
    "convergence.png": [PACKAGE / x.format("order") for x in FIGURE],
    "drift.png": [PACKAGE / x.format("drift") for x in FIGURE],
    "errors_over_time.png": [EXAMPLES / "errors_over_time.py", PACKAGE / "studies/figures.py"],
    "walker.png": [EXAMPLES / "walker.py"],
    "foot_path.png": [EXAMPLES / "foot_path.py"],
    "long_time_energy.png": [EXAMPLES / "long_time_energy.py", PACKAGE / "studies/figures.py"],
    "foot_bands.png": [PACKAGE / x.format("tolerance") for x in FIGURE],
    "optimal_control.png": [EXAMPLES / "optimal_control.py", *(PACKAGE / x.format("optimal_control") for x in FIGURE)],
}


def main(folder: Path = FOLDER) -> dict[str, int]:
    """Draw all pictures into a folder; returns their sizes in bytes."""
    replays(folder)
    replay_page(folder)
    work_precision(folder)
    convergence(folder)
    drift(folder)
    foot_bands(folder)
    example("errors_over_time", folder)
    example("foot_path", folder)
    example("optimal_control", folder)
    example("walker", folder)
    example("long_time_energy", folder)
    return {path.name: path.stat().st_size for path in sorted(folder.glob("*.png"))}


def replays(folder: Path, names: Sequence[str] = tuple(REPLAYS)) -> None:
    """Scenes of models side by side, three in a row."""
    tiles = [replay(name, *REPLAYS[name]) for name in names]
    width, height = tiles[0].size
    sheet = Image.new("RGB", (3 * width, -(-len(tiles) // 3) * height), "white")
    for k, tile in enumerate(tiles):
        sheet.paste(tile, (k % 3 * width, k // 3 * height))
    write(sheet, folder / "replays.png")


def replay(name: str, end: float, share: float) -> Image.Image:
    """The scene of a model's replay, without plots."""
    mech = mbdae.load(name)
    sol = mbdae.solve(mech, (0, end), rtol=1e-6)
    return video.still(page(sol, plots=(), fps=30 * min(1.0, end)), share, (400, 260))


def replay_page(folder: Path, end: float = 5.0, size: tuple[int, int] = (1200, 675)) -> None:
    """A whole replay page: two solutions, the path of a point, the force in a joint, and signals."""
    mech = mbdae.load("slider_crank")
    sol = mbdae.solve(mech, (0, end), rtol=1e-8)
    coarse = mbdae.solve(mech, (0, end), method="herk1", step=0.01)
    text = page(sol, traces=["rod_tip"], ghosts={"herk1, h = 0.01 s": coarse}, arrows=["wrist pin"])
    write(video.still(text, 0.74, size), folder / "replay_page.png")


def work_precision(
    folder: Path, end: float = 5.0, methods: Sequence[str] = METHODS, tolerances: Sequence[float] = TOLERANCES
) -> None:
    """Errors of methods over linear solves and over time."""
    result = mbdae.compare(mbdae.load("four_bar"), (0, end), methods=methods, rtol=tolerances)
    result.plot(folder / "work_precision.png")
    reduce(folder / "work_precision.png")


def convergence(folder: Path, methods: Sequence[str] = ("herk3", "herk5", "pherk5", "rk4")) -> None:
    """Observed and claimed orders."""
    mbdae.order(mbdae.load("four_bar"), methods=methods).plot(folder / "convergence.png")
    reduce(folder / "convergence.png")


def drift(folder: Path, end: float = 10.0, methods: Sequence[str] = ("herk3", "herk5", "pherk5")) -> None:
    """Drift of the closures and of the energy, with and without projection."""
    mech = mbdae.load("four_bar")
    runs = [mbdae.solve(mech, (0, end), method=name, rtol=1e-6, project=False) for name in methods]
    runs.append(mbdae.solve(mech, (0, end), rtol=1e-6, project=True))
    figures.save(drifts([mbdae.drift(sol).history for sol in runs]), folder / "drift.png")
    reduce(folder / "drift.png")


def foot_bands(folder: Path) -> None:
    """Tolerance bands of the foot of Jansen's leg: 0.2 mm in every length, 0.1 mm in the pins of its closures."""
    mech, signals = mbdae.load("jansen_walker?legs=1"), ["position.foot_0.x", "position.foot_0.z"]
    pins = {closure.name: 1e-4 for closure in mech.closures}
    found = mbdae.tolerance(mech, "crank", signals, {"*.xyz.[02]": 2e-4}, pins, points=181)
    figures.save(band(found, "foot_0"), folder / "foot_bands.png")
    reduce(folder / "foot_bands.png", 16)


def example(name: str, folder: Path) -> None:
    """The picture of an example."""
    spec = spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(plot=folder / f"{name}.png")
    reduce(folder / f"{name}.png")


def reduce(path: Path, colours: int = COLOURS) -> None:
    """Write a picture again with few colours."""
    with Image.open(path) as image:
        image.load()
    write(image, path, colours)


def write(image: Image.Image, path: Path, colours: int = COLOURS) -> None:
    """Write a picture with few colours, and the digest of the code that drew it."""
    info = PngImagePlugin.PngInfo()
    info.add_text(KEY, digest(path.name))
    image.convert("RGB").quantize(colours, kmeans=2).save(path, optimize=True, pnginfo=info)


def digest(name: str) -> str:
    """A digest of the code that draws a picture."""
    found = hashlib.sha256()
    for path in (x for pattern in SOURCES[name] for x in sorted(pattern.parent.glob(pattern.name))):
        text = path.read_text("utf-8")
        found.update((code_text(text) if path.suffix == ".py" else text).encode())
    return found.hexdigest()[:16]


def code_text(text: str) -> str:
    """Statements of a module, one a line, without comments, docstrings and white space between tokens.

    The same in every version of Python: f-strings, which newer tokenizers divide, are taken whole from the text.
    """
    rows, statements = io.StringIO(text).readlines(), list[str]()
    tokens, indent, depth, begin = list[tuple[str, str]](), 0, 0, (0, 0)
    for kind, word, start, end, _ in tokenize.generate_tokens(iter(rows).__next__):
        name = tokenize.tok_name[kind]
        if name == "FSTRING_START":
            begin, depth = (begin if depth else start), depth + 1
        if name == "FSTRING_END":
            depth, name, word = depth - 1, "OP", between(rows, begin, end)
        if depth or name in ("NL", "COMMENT", "INDENT", "DEDENT", "ENDMARKER"):
            continue
        if name == "NEWLINE":
            if any(kind != "STRING" for kind, _ in tokens):
                statements.append(" " * indent + " ".join(word for _, word in tokens))
            tokens = []
            continue
        indent = indent if tokens else start[1]
        tokens.append((name, word))
    return "\n".join(statements)


def between(rows: Sequence[str], start: tuple[int, int], end: tuple[int, int]) -> str:
    """Text between two positions, (line from 1, column from 0), of the lines of a file."""
    (i, a), (j, b) = start, end
    return "".join(rows[i - 1 : j])[a : len("".join(rows[i - 1 : j - 1])) + b]


def outdated(pictures: Iterable[Path]) -> list[str]:
    """Names of pictures that were drawn by older code."""
    names = []
    for path in pictures:
        with Image.open(path) as image:
            if path.name in SOURCES and image.info.get(KEY) != digest(path.name):
                names.append(path.name)
    return sorted(names)


if __name__ == "__main__":
    for name, size in main().items():
        print(f"{name:24}{size / 1000:8.1f} kB")
