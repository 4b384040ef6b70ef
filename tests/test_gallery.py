"""The script that draws the pictures of the pages runs, and the pictures that stand there are small."""

from pathlib import Path

import numpy as np
from browser import Chromium
from PIL import Image
from test_examples import example

PICTURES = list((Path(__file__).parent.parent / "examples" / "pictures").iterdir())


def test_the_gallery_is_drawn(tmp_path):
    Chromium()
    gallery, folder = example("gallery"), tmp_path / "pictures"
    folder.mkdir()
    gallery.replays(folder, ["four_bar"])
    gallery.replay_page(folder)
    gallery.work_precision(folder, 0.3, ("herk3", "pherk5"), (1e-3, 1e-4))
    gallery.drift(folder, 0.5, ("pherk5",))
    drawn = {path.name for path in folder.iterdir()}
    elsewhere = {"convergence.png", "work_precision_peers.png", "foot_path.png"}  # other tests draw them
    assert drawn | elsewhere == {path.name for path in PICTURES}
    for name in drawn:
        with Image.open(folder / name) as image:
            assert np.ptp(np.asarray(image.convert("L"))) > 150, f"{name} is empty"


def test_the_pictures_are_small():
    assert sum(p.stat().st_size for p in PICTURES) < 400_000
