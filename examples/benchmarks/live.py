"""Frames per second of a live view that a headless browser draws, without a graphics card.

Run: python examples/benchmarks/live.py [MODEL] [SECONDS] [WIDTHxHEIGHT]    (needs chromium)
"""

import shutil
import subprocess
import sys
import tempfile
import time

import mbdae
from mbdae import backend
from mbdae.studies.live.live_view import LiveView

FLAGS = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--disable-gpu-compositing", "--no-first-run", "--hide-scrollbars"]  # fmt: skip

LOADING = 120.0  # s at most
SETTLING = 8.0  # s, in which a slow page begins to draw coarsely


def wait(view: LiveView, frames: int) -> None:
    """Wait until the page has drawn so many more frames."""
    last, latest = view.frames_drawn + frames, time.perf_counter() + LOADING
    while view.frames_drawn < last:
        if time.perf_counter() > latest:
            raise SystemExit(f"the page has drawn nothing within {LOADING:g} s")
        time.sleep(0.1)


def main(model: str = "panda_handle", seconds: float = 10.0, size: str = "800x600") -> float:
    """Print and return the frames per second that the page has drawn."""
    browser = shutil.which("chromium")
    if browser is None:
        raise SystemExit("chromium is not installed")
    profiles = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)  # processes of the browser end later
    with mbdae.live(model, record=False) as view, profiles as profile:
        window = f"--window-size={size.replace('x', ',')}"
        command = [browser, *FLAGS, window, f"--user-data-dir={profile}", "--remote-debugging-port=0", view.url]
        page = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait(view, 1)
            wait(view, 3)  # the page loads its meshes
            time.sleep(SETTLING)
            drawn, simulated, started = view.frames_drawn, view.t, time.perf_counter()
            time.sleep(seconds)
            if view.frames_drawn == drawn:  # on a busy machine
                wait(view, 1)
            spent = time.perf_counter() - started
            rate, factor = (view.frames_drawn - drawn) / spent, (view.t - simulated) / spent
        finally:
            page.terminate()
            page.wait()
    print(f"{model}, {size}: {rate:.1f} frames per second, {factor:.2f} of real time")
    print(f"{backend.status()}; {backend.machine_description()}")
    return rate


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(float, sys.argv[2:3]), *sys.argv[3:4])
