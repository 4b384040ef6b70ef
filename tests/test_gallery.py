"""The script that draws the pictures of the pages runs; the committed pictures are current and small."""

from pathlib import Path

import numpy as np
import pytest
from browser import Chromium
from PIL import Image
from test_examples import example

FOLDER = Path(__file__).parent.parent / "examples" / "pictures"
PICTURES = list(FOLDER.iterdir())


@pytest.mark.slow
def test_the_gallery_is_drawn(tmp_path):
    Chromium()
    gallery, folder = example("gallery"), tmp_path / "pictures"
    folder.mkdir()
    gallery.replays(folder, ["four_bar"])
    gallery.replay_page(folder, 1.0, (600, 340))
    gallery.work_precision(folder, 0.3, ("herk3", "pherk5"), (1e-3, 1e-4))
    gallery.drift(folder, 0.5, ("pherk5",))
    drawn = {path.name for path in folder.iterdir()}
    # other tests draw them
    examples = {"errors_over_time.png", "foot_path.png", "long_time_energy.png", "optimal_control.png", "walker.png"}
    elsewhere = {"convergence.png", "foot_bands.png", "work_precision_peers.png", *examples}
    assert drawn | elsewhere == {path.name for path in PICTURES}
    for name in drawn:
        with Image.open(folder / name) as image:
            assert np.ptp(np.asarray(image.convert("L"))) > 150, f"{name} is empty"


def test_the_pictures_are_small():
    assert sum(p.stat().st_size for p in PICTURES) < 480_000


def test_the_pictures_are_those_of_today_s_code():
    assert example("gallery").outdated(PICTURES) == [], "run python examples/gallery.py"


def test_a_picture_of_other_code_is_noticed(tmp_path):
    gallery, picture = example("gallery"), tmp_path / "drift.png"
    with Image.open(FOLDER / "drift.png") as image:
        gallery.write(image, picture)
        assert gallery.outdated([picture]) == []
        image.save(picture)
    assert gallery.outdated([picture]) == ["drift.png"]


COMMENTED = '''"""Doc."""


def f(x):  # more
    """Doc of
    two lines."""
    a = (1,  # one
         f"{x!r:>{x}} # {{{'a' + f'{x}'}" "b")

    if x: return f"""1
      {x}"""
'''
PLAIN = '''def f ( x ) :
    a = ( 1 , f"{x!r:>{x}} # {{{'a' + f'{x}'}" "b" )
    if x : return f"""1
      {x}"""'''


def test_pictures_are_current_in_every_version_of_python():
    """Syntax trees and tokens of f-strings differ between versions; comments and docstrings draw nothing."""
    assert example("gallery").code_text(COMMENTED) == PLAIN
    assert example("gallery").code_text(COMMENTED.replace("    if x", "if x")) != PLAIN
