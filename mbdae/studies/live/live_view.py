"""A simulated mechanism in a browser, in real time, until it is stopped."""

import atexit
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from contextvars import copy_context
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from ...errors import InputError, MbdaeError
from ...integrate.simulator.simulator import Simulator
from ...system import Array
from ...units import quantity
from .dimensions import Dimensions
from .frame_rate import FrameRate
from .live_scene import LiveScene
from .pulls import Pulls

if TYPE_CHECKING:
    from ...solution.solution import Solution

YIELD = 0.002  # s between frames
LATE = 0.25  # s behind real time, after which the view is slower than real time
NOTICED = 0.1  # deviation from real time that is shown


class ViewSettings(NamedTuple):
    """Settings of a live view, see `mbdae.live`; ``solver`` are those of its steps."""

    speed: float
    fps: float
    port: int | None
    play: bool
    record: bool
    shadows: bool
    ranges: Mapping[str, Sequence[float]]
    solver: Mapping[str, Any]


class LiveView:
    """A running live view; shown in notebooks, and a context that closes it.

    Attributes:
        url: address of the page.
        mechanism: the simulated mechanism, with the inputs of `mbdae.live`.
        playing: whether time passes.
        state: ``"running"``, ``"paused"``, or ``"stopped"`` after a failed step.
        message: why it has stopped.
        runs: the recorded solutions before the last reset or change of a parameter.
    """

    def __init__(self, dimensions: Dimensions, settings: ViewSettings) -> None:
        self._dimensions, self._settings = dimensions, settings
        self._use(0.0, *dimensions.mechanism.start)
        self.state, self.message = "running" if settings.play else "paused", ""
        self.runs: list[Solution] = []
        self._orders: SimpleQueue[dict[str, Any]] = SimpleQueue()
        self._stopping, self._rate = Event(), FrameRate(0.0)
        from .server import Server

        self._server = Server(self._commands, self._orders.put, settings.port)
        self.url = self._server.url
        self._thread = Thread(target=copy_context().run, args=(self._run,), name="simulator", daemon=True)
        self._thread.start()
        atexit.register(self.stop)  # the thread must not outlive the interpreter

    def _use(self, t: float, q: Array, v: Array, s: Array | None = None) -> None:
        """Simulate the mechanism with the present dimensions from a state on; a reset returns to it."""
        mech, settings = self._dimensions.mechanism, self._settings
        self._pulls = Pulls(mech, q, settings.ranges)
        self.mechanism = self._pulls.mechanism
        self._simulator = Simulator(self.mechanism, t, q, v, s, record=settings.record, **settings.solver)
        self._start, self._q = self._simulator.save(), q
        self._scene = LiveScene(self.mechanism.scene, q, settings.shadows)

    def __repr__(self) -> str:
        return f"<live view of {self.mechanism.title} at t = {self.t:.4g} s, {self.state}: {self.url}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" title="live view" style="width: 100%; height: 520px; border: 0"></iframe>'

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(self, *problem: object) -> None:
        self.stop()

    @property
    def t(self) -> float:
        """Simulated time in s."""
        return self._simulator.t

    @property
    def q(self) -> Array:
        """Configuration (nq,) of the last frame."""
        return self._q

    @property
    def frames_drawn(self) -> int:
        """Number of the last frame that all open pages have drawn; 0 without a page."""
        return min(list(self._server.pages.values()), default=0)

    @property
    def playing(self) -> bool:
        """Whether time passes."""
        return self.state == "running"

    def set(self, name: str, value: float) -> None:
        """Set an input or a parameter, as its slider does.

        Raises:
            UnknownNameError: lists the inputs.
            InputError: for a value that is not a finite number.
        """
        self._do({"parameter" if name in self._dimensions.values else "input": name, "value": value})

    def move(self, joint: str, value: float | None) -> None:
        """Pull a joint to a value in rad or m by a spring; None releases it.

        Raises:
            UnknownNameError: lists the joints with sliders.
            InputError: for a value that is not a finite number.
        """
        self._do({"joint": joint, "value": value})

    def pull(self, frame: str, target: Sequence[float]) -> None:
        """Pull the origin of a frame to a point of the world in m, (3,), by a spring; `drop` releases it.

        Raises:
            UnknownNameError: lists the frames.
            InputError: for a frame of the ground, or a target that is not three finite numbers.
        """
        self._do({"frame": frame, "to": list(target)})

    def drop(self) -> None:
        """Release the pulled point."""
        self._do({"drop": True})

    def play(self, on: bool = True) -> None:
        """Let time pass, or pause."""
        self._do({"play": on})

    def reset(self) -> None:
        """Return to the start; the run so far is added to ``runs``."""
        self._do({"reset": True})

    def _do(self, order: dict[str, Any]) -> None:
        """Check an order, and leave it to the simulator's thread."""
        if self._stopping.is_set():
            raise InputError("the live view has ended")
        self._check(order)
        self._orders.put(order)

    def stop(self) -> "Solution":
        """End the view; return the recorded run. The page says that it has ended."""
        self._stopping.set()
        atexit.unregister(self.stop)
        self._thread.join()
        self._server.close()
        return self._simulator.solution()

    def save(self, path: str | Path) -> list[str]:
        """Write the recorded runs of a view that has ended; return the paths.

        Runs before a reset have numbers: ``run-1.npz``, ``run-2.npz``, ..., and the last one the path itself.

        Raises:
            InputError: for a view that has not ended, another suffix or an unwritable path.
        """
        if not self._stopping.is_set():
            raise InputError("stop the live view before its runs are saved")
        path = Path(path)
        names = [path.with_stem(f"{path.stem}-{k}") for k in range(1, len(self.runs) + 1)]
        for name, sol in zip([*names, path], [*self.runs, self._simulator.solution()], strict=True):
            sol.save(name)
        return [str(name) for name in (*names, path)]

    # -- the thread of the simulator -------------------------------------------------------------------------------

    def _run(self) -> None:
        fps, speed = self._settings.fps, self._settings.speed
        due = perf_counter()
        while not self._stopping.is_set():
            self._obey()
            if self.playing:
                self._advance(speed / fps)
            self._q = self._simulator.q
            self._server.show(self._scene.frame(self._q, self._pulls.line), self._described())
            due += 1 / fps
            now = perf_counter()
            due = now if now - due > LATE else due
            self._rate.update(now, self.t, self.frames_drawn)
            if self._rate.slow and not self._scene.coarse:
                self._server.command(*self._scene.coarsen())
            self._stopping.wait(max(YIELD, due - now))  # the thread of the server needs time, too

    def _advance(self, dt: float) -> None:
        """Advance in pieces during which the springs are constant."""
        count = self._pulls.substeps(dt)
        try:
            for _ in range(count):
                self._pulls.apply(self._simulator)
                if self._simulator.advance(dt / count) == "event":
                    self.state, self.message = "paused", "an event has ended the advance"
                    return
        except Exception as e:  # the page reports it, and the record remains
            kind = "" if isinstance(e, MbdaeError) else f"{type(e).__name__}: "
            self.state, self.message = "stopped", f"{kind}{e}"

    def _obey(self) -> None:
        """Do what pages and callers have ordered since the last frame; of a dragged parameter the last value counts."""
        orders: list[dict[str, Any]] = []
        with suppress(Empty):
            while True:
                orders.append(self._orders.get_nowait())
        last = {x["parameter"]: i for i, x in enumerate(orders) if isinstance(x.get("parameter"), str)}
        for i, order in enumerate(orders):
            if last.get(order.get("parameter"), i) != i:
                continue
            try:
                self._check(order)
                self._act(order)
            except (MbdaeError, TypeError, ValueError, KeyError) as e:  # a page may send anything
                self.message = str(e)

    def _check(self, order: Mapping[str, Any]) -> None:
        self._dimensions.check(order)
        self._pulls.check(order)

    def _act(self, order: dict[str, Any]) -> None:
        if "play" in order:
            playing = self.state != "running" if order["play"] is None else order["play"]
            if self.state != "stopped":
                self.state, self.message = "running" if playing else "paused", ""
        elif "reset" in order:
            self._reset()
        elif "parameter" in order:
            self._change(order["parameter"], order["value"])
        elif self.state != "stopped":
            self._pulls.order(order, self._simulator, self._scene.bodies)

    def _change(self, name: str, value: float) -> None:
        """Go on with another value of a parameter; the run so far is kept, as by a reset."""
        old, coarse = self._simulator, self._scene.coarse
        q, v = self._dimensions.change(name, value, old.q, old.v)
        self._keep()
        self._use(old.t, q, v, old.s)
        paths, self.message = self._dimensions.drawn(q, self._scene.extent)
        self._server.command(*(self._scene.coarsen() if coarse else self._scene.redrawn()), *paths)
        self.state = "paused" if self.state == "stopped" else self.state

    def _keep(self) -> None:
        if self._settings.record and self.t != self._simulator.start:
            self.runs.append(self._simulator.solution())

    def _reset(self) -> None:
        self._keep()
        self._simulator.restore(self._start)
        self._pulls.release()
        self.state, self.message = "running" if self.state == "running" else "paused", ""
        self._server.command(*self._pulls.slider_values(self._simulator))

    def _described(self) -> dict[str, Any]:
        """Return the state for the pages, as text and data."""
        text = f"{self.mechanism.title}\nt = {quantity(self.t, 's', '.2f')}"
        factor = self._rate.real_time_factor
        slow = self.playing and abs(factor - 1) > NOTICED and f" ({factor:.2g} of real time)"
        text += slow or ("" if self.playing else f", {self.state}")
        text += f"\n{self.message}" if self.message else ""
        page = {"camera": self._scene.camera, "coarse": self._scene.coarse}
        return {"text": text, "t": self.t, "state": self.state, "wrong": self.state == "stopped", **page}

    def _commands(self) -> Iterator[dict[str, Any]]:
        """Yield the commands that draw the scene and the controls for a new page."""
        yield from self._scene.commands()
        yield from self._scene.frame(self._q, self._pulls.line)
        yield from self._dimensions.drawn(self._q, self._scene.extent)[0]
        yield from self._pulls.controls(self._simulator)
        yield from self._dimensions.controls()
