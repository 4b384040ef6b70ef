"""Videos of a replay: frames drawn by a browser, and messages when it or the library is missing."""

import sys
from itertools import pairwise

import numpy as np
import pytest
from browser import Chromium, changed
from PIL import Image

import mbdae
from mbdae.errors import InputError
from mbdae.studies.replay import video
from mbdae.studies.replay.replay import animate


@pytest.fixture(scope="module")
def crank():
    return mbdae.solve(mbdae.load("slider_crank"), (0, 2), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_a_video(crank, tmp_path, suffix):
    Chromium()
    reported = []
    path = animate(crank, tmp_path / f"run{suffix}", fps=2, speed=2.0, arrows=True, progress=reported.append)
    assert reported == pytest.approx([1 / 3, 2 / 3, 1])
    if suffix == ".mp4":
        import imageio_ffmpeg

        frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
        assert (frames, seconds) == (3, pytest.approx(1.5, abs=0.1))
        return
    with Image.open(path) as image:
        assert (image.n_frames, image.info["duration"], image.size) == (3, 500, (960, 540))
        pictures = []
        for k in range(3):
            image.seek(k)
            pictures.append(np.asarray(image.convert("RGB"), dtype=int))
    assert all(changed(a, b) > 0.005 for a, b in pairwise(pictures))


def test_what_a_video_takes_is_said(crank, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(video.shutil, "which", lambda name: "/bin/false")
    with pytest.raises(InputError, match=r'pip install "mbdae\[video\]"'):
        animate(crank, tmp_path / "run.mp4", plots=())
    with pytest.raises(mbdae.MbdaeError, match="/bin/false drew 0 of"):
        animate(crank, tmp_path / "run.gif", plots=())
    slow = tmp_path / "slow"
    slow.write_text("#!/bin/sh\nexec sleep 9\n")
    slow.chmod(0o755)
    monkeypatch.setattr(video, "TIMEOUT", 0.01)
    monkeypatch.setattr(video.shutil, "which", lambda name: str(slow))
    with pytest.raises(mbdae.MbdaeError, match=r"slow drew nothing within 0\.01 s"):
        animate(crank, tmp_path / "run.gif", plots=())
    slow.unlink()
    monkeypatch.setattr(video.shutil, "which", lambda name: None)
    with pytest.raises(InputError, match=r"one of chromium, .*none is found"):
        animate(crank, tmp_path / "run.gif", plots=())
    assert not list(tmp_path.iterdir())
