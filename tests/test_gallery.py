"""The script that draws the README's pictures runs, and the pictures that stand there are small."""

import re
from pathlib import Path

import numpy as np
from browser import Chromium
from PIL import Image
from test_examples import example

ROOT = Path(__file__).parent.parent


def test_the_gallery_is_drawn(tmp_path):
    Chromium(tmp_path)
    gallery, folder = example("gallery"), tmp_path / "pictures"
    folder.mkdir()
    gallery.replays(folder, ["four_bar"])
    gallery.replay_page(folder)
    gallery.work_precision(folder, 0.3, ("herk3", "pherk5"), (1e-3, 1e-4))
    gallery.drift(folder, 0.5, ("pherk5",))
    drawn = {path.name for path in folder.iterdir()}
    shown = re.findall(r"!\[[^\]]+\]\(examples/pictures/([^)]+)\)", (ROOT / "README.md").read_text())
    elsewhere = {"convergence.png", "work_precision_peers.png"}  # take long: tests of figures and benchmarks draw them
    assert drawn | elsewhere == set(shown)
    for name in drawn:
        with Image.open(folder / name) as image:
            assert np.ptp(np.asarray(image.convert("L"))) > 150, f"{name} is empty"


def test_the_pictures_are_small():
    pictures = list((ROOT / "examples" / "pictures").iterdir())
    assert sum(p.stat().st_size for p in pictures) < 350_000
