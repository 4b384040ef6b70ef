"""The picture and the page of documentation in an exported FMU."""

import zipfile
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from fmu_masters import fmpy

import mbdae
from mbdae.errors import InputError
from mbdae.studies.export import picture

pytestmark = pytest.mark.native


class Sources(HTMLParser):
    """Collects the pictures of a page."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag == "img":
            self.found.append(dict(attributes)["src"])


def test_the_mechanism_is_shown(tmp_path):
    """The red wheel and the yellow slider of slider_crank, in the pictures that FMPy and the page show."""
    image = pytest.importorskip("PIL.Image")
    unit = mbdae.export("slider_crank", tmp_path / "x.fmu", kind="cs", step=1e-3)
    folder = Path(fmpy.extract(str(unit.path), tmp_path / "x"))
    page = (folder / "documentation" / "index.html").read_text("utf-8")
    shown = [folder / "documentation" / x for x in Sources(page).found]
    assert [x.name for x in shown] == ["diagram.png"]
    assert shown[0].read_bytes() == (folder / "model.png").read_bytes()
    pixels = np.asarray(image.open(folder / "model.png").convert("RGB")).astype(float) / 255
    red, green, blue = np.moveaxis(pixels, -1, 0)
    wheel, slider = (red > 0.5) & (green < 0.3), (red > 0.6) & (green > 0.5) & (blue < 0.4)
    assert wheel.mean() > 0.05
    assert slider.mean() > 0.005
    across = [np.flatnonzero(x.any(axis=0)).mean() for x in (wheel, slider)]
    assert across[0] < across[1]  # the slider is to the right of the wheel
    assert pytest.importorskip("fmpy.validation").validate_fmu(str(unit.path)) == []


def test_an_fmu_without_a_picture(tmp_path, monkeypatch):
    """The mechanism cannot be moved from its start: there is nothing to choose a view by."""

    def fails(*args, **named):
        raise InputError("no motion")

    monkeypatch.setattr(picture, "solve", fails)
    unit = mbdae.export("pendulum", tmp_path / "x.fmu", kind="cs", step=1e-3)
    with zipfile.ZipFile(unit.path) as file:
        assert not [name for name in file.namelist() if name.endswith(".png")]
        assert not Sources(file.read("documentation/index.html").decode()).found


def test_the_same_mechanism_gives_the_same_picture():
    image = pytest.importorskip("PIL.Image")
    one, other = (picture.picture(mbdae.load("pendulum")) for _ in range(2))
    assert one == other
    assert image.open(BytesIO(one)).format == "PNG"
