"""A headless browser for the tests: pages are opened, captured as images, and queried by scripts.

One browser serves a whole session of tests, by the pipe of its debugging protocol; every page is a separate tab. A tab
of a closed page is reused for the next page, which avoids starting a new tab.
"""

import atexit
import base64
import json
import os
import shutil
import subprocess
import tempfile
from functools import cache
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

FLAGS = "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
FLAGS += " --disable-background-networking --no-first-run --remote-debugging-pipe --hide-scrollbars"
FLAGS += " --disable-gpu-compositing"  # pages are composed without the emulated GPU, in half the time
FLAGS += " --webgl-antialiasing-mode=none"  # antialiasing takes two thirds of the time of the emulated GPU
READY = """new Promise((done, failed) => {
  const look = () => {
    const clock = document.getElementById("clock");
    if (clock && clock.textContent.includes("needs a browser")) failed(clock.textContent);
    else if (document.readyState === "complete" && (%s)) done(1);
    else setTimeout(look, 10);
  };
  look();
})"""
SCRIPT = """(async () => {
  const log = {}, wait = seconds => new Promise(done => setTimeout(done, 1000 * seconds));
  %s
  return JSON.stringify(log);
})()"""

WITHOUT = """(() => {
  const root = nodeOf(mbdae.viewer, "mechanism"), pane = mbdae.viewer.renderer.domElement;
  const look = () => { mbdae.viewer.render(); return pane.toDataURL(); };
  nodeOf(mbdae.viewer, "ground").visible = false;
  const full = look(), hidden = root.children.filter(x => x.visible);
  for (const x of hidden) x.visible = false;
  const empty = look();
  for (const x of hidden) x.visible = true;
  return [full, empty];
})()"""


def picture_of(url):
    """Return the pixels of a data address, (height, width, 3)."""
    return _pixels(url.partition(",")[2])


def _pixels(data):
    with Image.open(BytesIO(base64.b64decode(data))) as image:
        return np.asarray(image.convert("RGB"), dtype=int)


def changed(a, b):
    """Return the fraction of pixels that differ."""
    return (np.abs(a - b).max(axis=2) > 20).mean()


class Chromium:
    """A browser that opens pages; a replay is loaded when its scene is drawn."""

    def __init__(self):
        self.browser = _browser()

    def open(self, address, size=(600, 400), ready="window.mbdae"):
        """Return a tab with a page, by its address or path, without shadows, which are slow, once it is ready."""
        address = address if isinstance(address, str) else f"{address.as_uri()}#shadows=0"
        return Tab(self.browser, address, size, ready)

    def shot(self, page, t, size=(600, 400), **more):
        """Return the picture of a page paused at a time, (height, width, 3); ``more`` is added to its address."""
        words = "&".join(f"{key}={value}" for key, value in {"t": t, "shadows": 0, **more}.items())
        with self.open(f"{page.as_uri()}#{words}", size) as tab:
            return tab.picture()

    def ask(self, page, script, size=(600, 400)):
        """Return the entries of `log` written by a script once the scene is drawn."""
        with self.open(page, size) as tab:
            return tab.ask(script)


class Tab:
    """One page in the browser."""

    def __init__(self, browser, address, size, ready):
        self.browser = browser
        self.session = browser.left.pop() if browser.left else browser.blank()
        self.resize(size)
        self.navigate(address, ready)

    def navigate(self, address, ready="window.mbdae"):
        """Load a page, until it is ready."""
        self.call("Page.navigate", url=address)
        self.evaluate(READY % ready)

    def __enter__(self):
        return self

    def __exit__(self, *problem):
        self.call("Page.navigate", url="about:blank")
        self.browser.left.append(self.session)

    def call(self, method, **parameters):
        return self.browser.call(method, self.session, **parameters)

    def resize(self, size):
        width, height = size
        more = {"deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, **more)
        self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def evaluate(self, expression):
        more = {"awaitPromise": True, "returnByValue": True}
        answer = self.call("Runtime.evaluate", expression=expression, **more)
        problem = answer.get("exceptionDetails")
        assert not problem, problem["exception"].get("description", problem["exception"].get("value"))
        return answer["result"].get("value")

    def ask(self, script):
        """Return the entries of `log` written by a script."""
        return json.loads(self.evaluate(SCRIPT % script))

    def at(self, t):
        """Return the picture at a time of the motion."""
        self.evaluate(f"mbdae.seek({t}); 0")
        return self.picture()

    def mouse(self, *steps):
        """Send mouse events (event, x, y): moved, pressed or released."""
        for what, x, y in steps:
            button = {"button": "none"} if what == "Moved" else {"button": "left", "clickCount": 1}
            self.call("Input.dispatchMouseEvent", type=f"mouse{what}", x=x, y=y, **button)

    def picture(self):
        """Return the visible picture, (height, width, 3)."""
        return _pixels(self.call("Page.captureScreenshot", format="png")["data"])

    def drawn(self):
        """Return the position of the mechanism in the scene: the pixels that change when it is hidden."""
        full, empty = map(picture_of, self.evaluate(WITHOUT))
        return np.abs(full - empty).max(axis=2) > 12


class Pipe:
    """Debugging protocol: JSON separated by zeros, calls through one pipe, answers through another."""

    def __init__(self, program):
        self.profile = tempfile.TemporaryDirectory()
        calls, self.calls = os.pipe()
        answers, replies = os.pipe()
        numbered = f"exec {program} {FLAGS} --user-data-dir={self.profile.name} 3<&{calls} 4>&{replies}"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen(["bash", "-c", numbered], pass_fds=(calls, replies), **quiet)
        os.close(calls)
        os.close(replies)
        self.answers, self.count = os.fdopen(answers, "rb"), 0
        self.rest, self.left = b"", []

    def blank(self):
        """Return the session of a new tab."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        return self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]

    def call(self, method, session=None, **parameters):
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        data = json.dumps(message | ({"sessionId": session} if session else {})).encode() + b"\0"
        while data:
            data = data[os.write(self.calls, data) :]
        while True:
            answer = json.loads(self.message())
            if answer.get("id") == self.count:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def message(self):
        while b"\0" not in self.rest:
            data = os.read(self.answers.fileno(), 1 << 20)
            assert data, "the browser has ended"
            self.rest += data
        message, _, self.rest = self.rest.partition(b"\0")
        return message

    def close(self):
        os.close(self.calls)
        self.process.wait(timeout=20)
        self.answers.close()
        self.profile.cleanup()


@cache
def _browser():
    found = [shutil.which(n) for n in ("chromium", "chromium-browser", "google-chrome", "chrome")]
    if not any(found):
        pytest.skip("no chromium found")
    browser = Pipe(next(f for f in found if f))
    atexit.register(browser.close)
    return browser
