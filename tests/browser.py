"""A browser without a window for the tests: pages are opened, photographed, and asked by scripts put into them."""

import html
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

FLAGS = "--headless --no-sandbox --use-gl=swiftshader --enable-unsafe-swiftshader --disable-background-networking"
PROBE = """<script>
  const hold = holdLoad(), wait = seconds => new Promise(done => setTimeout(done, 1000 * seconds));
  (async () => {
    while (!window.mbdae) await wait(0.05);
    const log = {};
    try { %s } catch (error) { log.error = String(error); }
    document.title = JSON.stringify(log);
    hold();
  })();
</script></body>"""


def changed(a, b):
    """The share of pixels that differ."""
    return (np.abs(a - b).max(axis=2) > 20).mean()


class Chromium:
    """Opens pages; a page counts as loaded when its scene stands."""

    def __init__(self, folder):
        found = [shutil.which(n) for n in ("chromium", "chromium-browser", "google-chrome", "chrome")]
        if not any(found):
            pytest.skip("no chromium found")
        self.command = [next(f for f in found if f), *FLAGS.split(), f"--user-data-dir={folder / 'profile'}"]

    def run(self, url, *options, size=(600, 400)):
        command = [*self.command, "--window-size={},{}".format(*size), *options, url]
        return subprocess.run(command, capture_output=True, timeout=120, check=True).stdout.decode()

    def shot(self, page, t, size=(600, 400)):
        """The picture of a page standing at a time, (height, width, 3)."""
        picture = page.with_suffix(".png")
        self.run(f"{page.as_uri()}#t={t}", f"--screenshot={picture}", size=size)
        with Image.open(picture) as image:
            return np.asarray(image.convert("RGB"), dtype=int)

    def ask(self, page, script, size=(600, 400)):
        """What a script notes in `log` once the scene stands; `page` is changed for it."""
        page.write_text(page.read_text("utf-8").replace("</body>", PROBE % script), "utf-8")
        title = re.search("<title>(.*?)</title>", self.run(page.as_uri(), "--dump-dom", size=size), re.S)[1]
        log = json.loads(html.unescape(title))
        assert "error" not in log, log["error"]
        return log
