"""The server of a live view: meshcat's page and socket for the scene, and a socket for controls and state."""

import asyncio
import json
import socket
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from contextvars import copy_context
from pathlib import Path
from threading import Event, Thread
from typing import Any

import tornado.httpserver
import tornado.web
import tornado.websocket
import umsgpack

from ...errors import InputError
from ..replay.html_page import viewer_folder

FOLDER = Path(__file__).parent
BACKLOG = 3  # number of frames that a page may not have drawn yet
FIRST_PORT, PORTS = 7000, 100


class Server:
    """Serves one scene to any number of pages, in a separate thread.

    Args:
        scene: returns the commands that draw the current scene.
        received: called with each message of a page, in the thread of the server.
        port: port of the page; by default the first free port from 7000.

    Attributes:
        url: address of the page.
        pages: sockets of the open pages, with the number of the last frame that each has drawn.

    Raises:
        InputError: for a port that is in use.
    """

    def __init__(
        self,
        scene: Callable[[], Iterable[Mapping[str, Any]]],
        received: Callable[[dict[str, Any]], None],
        port: int | None = None,
    ) -> None:
        self.scene, self.received = scene, received
        self.scenes: set[Any] = set()
        self.pages: dict[Any, int] = {}
        self.count = 0
        self._loop = asyncio.new_event_loop()
        self._ready, self._failed = Event(), ""
        self._thread = Thread(target=copy_context().run, args=(self._serve, port), name="live view", daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failed:
            self._thread.join()
            raise InputError(self._failed)

    def _serve(self, port: int | None) -> None:
        asyncio.set_event_loop(self._loop)
        app = tornado.web.Application([
            (r"/static/(?:index[.]html)?", _Page),
            (r"/static/(live[.]js)", tornado.web.StaticFileHandler, {"path": str(FOLDER)}),
            (r"/static/(.*)", tornado.web.StaticFileHandler, {"path": str(viewer_folder())}),
            (r"/", _Scene, {"server": self}),
            (r"/live", _Controls, {"server": self}),
        ], log_function=lambda handler: None)  # fmt: skip
        try:
            bound = _bound(port)
        except (OSError, OverflowError, TypeError) as e:
            reason = getattr(e, "strerror", None) or e
            self._failed = "no free port is found" if port is None else f"port {port} cannot be used: {reason}"
            self._loop.close()
            self._ready.set()
            return
        self.url = f"http://127.0.0.1:{bound.getsockname()[1]}/static/"
        self._http = self._loop.run_until_complete(_listen(app, bound))
        self._ready.set()
        self._loop.run_forever()
        self._loop.run_until_complete(self._http.close_all_connections())
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    def show(self, commands: Iterable[Mapping[str, object]], state: Mapping[str, object]) -> bool:
        """Send a frame to the pages; return False, without sending it, if a slow page has a backlog."""
        if self.pages and self.count - min(self.pages.values()) >= BACKLOG:
            return False
        self.count += 1
        packed = [umsgpack.packb(command) for command in commands]
        self._loop.call_soon_threadsafe(self._send, packed, json.dumps({**state, "frame": self.count}))
        return True

    def command(self, *commands: Mapping[str, Any]) -> None:
        """Send commands of meshcat to the pages."""
        self._loop.call_soon_threadsafe(self._send, [umsgpack.packb(command) for command in commands], "")

    def _send(self, packed: list[bytes], state: str) -> None:
        for page in list(self.scenes):
            for data in packed:
                _write(page, data)
        for page in list(self.pages) if state else ():
            _write(page, state)

    def close(self) -> None:
        """Stop the server; open pages report it."""
        if self._loop.is_closed():
            return

        def stop() -> None:
            self._http.stop()
            for page in (*self.scenes, *self.pages):
                page.close()
            self._loop.call_later(0.05, self._loop.stop)  # after the closing frames

        self._loop.call_soon_threadsafe(stop)
        self._thread.join()


def _bound(port: int | None) -> socket.socket:
    """Return a socket that is bound to a port, or to the first free one."""
    for number in range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else [port]:
        try:
            found = socket.create_server(("127.0.0.1", number))
            found.setblocking(False)
            return found
        except OSError:
            if number in (port, FIRST_PORT + PORTS - 1):
                raise
    raise AssertionError


async def _listen(app: tornado.web.Application, bound: socket.socket) -> tornado.httpserver.HTTPServer:
    out = tornado.httpserver.HTTPServer(app)
    out.add_socket(bound)
    return out


def _write(page: Any, data: bytes | str) -> None:
    with suppress(tornado.websocket.WebSocketClosedError):  # on_close follows
        page.write_message(data, binary=isinstance(data, bytes))


class _Page(tornado.web.RequestHandler):
    """Meshcat's page with the script of the live view."""

    def get(self) -> None:
        text = (viewer_folder() / "index.html").read_text("utf-8")
        self.set_header("Cache-Control", "no-store")
        self.finish(text.replace("</body>", "") + '<script src="live.js"></script>')


class _Scene(tornado.websocket.WebSocketHandler):
    """Meshcat's socket: commands in msgpack."""

    def initialize(self, server: Server) -> None:
        self.server = server

    def open(self, *args: str, **kwargs: str) -> None:
        for command in self.server.scene():
            self.write_message(umsgpack.packb(command), binary=True)
        self.server.scenes.add(self)

    def on_message(self, message: str | bytes) -> None:
        """Ignore messages: the viewer sends only pictures, which are not requested."""

    def on_close(self) -> None:
        self.server.scenes.discard(self)


class _Controls(tornado.websocket.WebSocketHandler):
    """JSON socket: sends the simulation state to a page; receives inputs, buttons, dragged points, drawn frames."""

    def initialize(self, server: Server) -> None:
        self.server = server

    def open(self, *args: str, **kwargs: str) -> None:
        self.server.pages[self] = self.server.count

    def on_message(self, message: str | bytes) -> None:
        try:
            found = json.loads(message)
        except ValueError:
            return
        if isinstance(found, dict) and isinstance(found.get("frame"), int):
            self.server.pages[self] = found["frame"]
        elif isinstance(found, dict):
            self.server.received(found)

    def on_close(self) -> None:
        self.server.pages.pop(self, None)
