"""Videos of a replay: a headless browser draws the frames of the page, and a library encodes them."""

import base64
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ...errors import InputError, MbdaeError
from ...file_io import VIDEO_SUFFIXES, atomic_write

if TYPE_CHECKING:
    from PIL.Image import Image

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
FLAGS = "--headless --use-gl=swiftshader --enable-unsafe-swiftshader --disable-background-networking --dump-dom"
BATCH = 40  # number of frames per start of the browser, limited by its memory
TIMEOUT = 300.0  # s, for a batch


def film(page: str, path: Path, fps: float, seconds: float, progress: Callable[[float], None] | None = None) -> None:
    """Write a video of a page of `mbdae.studies.replay.replay`, from the start of the motion to its end.

    Args:
        page: the page.
        path: the ``.mp4`` (H.264) or ``.gif`` to write, atomically.
        fps: frames per second.
        seconds: duration of the video.
        progress: called with the fraction of drawn frames.

    Raises:
        InputError: for a missing browser or library, or an unwritable path.
        MbdaeError: if the browser draws nothing.
    """
    browser = _browser()
    video = VIDEO[path.suffix]
    count = round(seconds * fps) + 1

    def frames() -> Iterator["Image"]:
        for first in range(0, count, BATCH):
            last = min(count, first + BATCH)
            for k, frame in enumerate(_frames(browser, page, first, last, count, video.size), first + 1):
                yield frame
                if progress:
                    progress(k / count)

    with atomic_write(path) as draft:
        video.pack(draft, frames(), fps)


def still(page: str, fraction: float, size: tuple[int, int]) -> "Image":
    """Return a picture of a page, (width, height) pixels, at a fraction of the motion from 0 to 1.

    Raises:
        InputError: if no browser is found.
        MbdaeError: if the browser draws nothing.
    """
    k = round(1000 * fraction)
    return _frames(_browser(), page, k, k + 1, 1001, size)[0]


def _browser() -> str:
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise InputError(f"a video needs a browser, one of {', '.join(BROWSERS)}: none is found")
    return found


def _frames(browser: str, page: str, first: int, last: int, count: int, size: tuple[int, int]) -> list["Image"]:
    """Return frames first to last - 1 of count, from the text of the page to which the browser writes them."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "page.html")
        file.write_text(page, "utf-8")
        address = f"{file.as_uri()}#film={first},{last},{count},{size[0]}x{size[1]}"
        command = [browser, *FLAGS.split(), f"--user-data-dir={folder}/profile"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.append("--no-sandbox")  # the sandbox is not available to root
        try:
            done = subprocess.run([*command, address], capture_output=True, timeout=TIMEOUT, check=False)
        except subprocess.TimeoutExpired:
            raise MbdaeError(f"{browser} drew nothing within {TIMEOUT:g} s") from None
    pictures = re.findall(rb"data:image/png;base64,([\w+/=]+)\n", done.stdout)
    if len(pictures) != last - first:
        raise MbdaeError(f"{browser} drew {len(pictures)} of {last - first} frames")
    return [Image.open(BytesIO(base64.b64decode(data))).convert("RGB") for data in pictures]


def _mp4(path: Path, frames: Iterator["Image"], fps: float) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise InputError('a .mp4 needs imageio-ffmpeg: pip install "mbdae[video]"; a .gif needs nothing more') from None
    first = next(frames)
    writer = imageio_ffmpeg.write_frames(str(path), first.size, fps=fps, macro_block_size=2, quality=7)
    writer.send(None)
    writer.send(first.tobytes())
    for frame in frames:
        writer.send(frame.tobytes())
    writer.close()


def _gif(path: Path, frames: Iterator["Image"], fps: float) -> None:
    """Write a .gif with the palette of the first frame in all frames, which prevents flicker."""
    first = next(frames).quantize(255, kmeans=2)
    rest = [frame.quantize(palette=first) for frame in frames]
    first.save(path, save_all=True, append_images=rest, duration=round(1000 / fps), loop=0, optimize=True)


class Video(NamedTuple):
    """A format of videos.

    Attributes:
        fps: default frames per second.
        size: (width, height) in pixels.
        pack: writes frames to a path.
    """

    fps: float
    size: tuple[int, int]
    pack: Callable[[Path, Iterator["Image"], float], None]


VIDEO = dict(zip(VIDEO_SUFFIXES, (Video(30.0, (1280, 720), _mp4), Video(20.0, (960, 540), _gif)), strict=True))
