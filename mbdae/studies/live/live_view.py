"""A running live view: the thread that simulates a mechanism in real time and draws it in a browser."""

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

YIELD = 0.002  # s, shortest wait between frames
LATE = 0.25  # s behind real time, after which the delay is not made up
NOTICED = 0.1  # deviation of the real-time factor from 1 that is shown


class ViewSettings(NamedTuple):
    """Settings of a live view, see `mbdae.live`; ``solver`` has the arguments of the simulator."""

    speed: float
    fps: float
    port: int | None
    play: bool
    record: bool
    shadows: bool
    ranges: Mapping[str, Sequence[float]]
    solver: Mapping[str, Any]


class LiveView:
    """A running live view, displayed in notebooks; as a context manager it stops at the end.

    Attributes:
        url: address of the page.
        mechanism: the simulated mechanism, with the inputs of `mbdae.live`.
        playing: whether time passes.
        state: ``"running"``, ``"paused"``, or ``"stopped"`` after a failed step.
        message: why the simulation has stopped.
        runs: the recorded solutions before the last reset or change of a parameter.
    """

    def __init__(self, dimensions: Dimensions, settings: ViewSettings) -> None:
        self._dimensions, self._settings = dimensions, settings
        self._start_simulation(0.0, *dimensions.mechanism.start)
        self.state, self.message = "running" if settings.play else "paused", ""
        self.runs: list[Solution] = []
        self._requests: SimpleQueue[dict[str, Any]] = SimpleQueue()
        self._stopping, self._rate = Event(), FrameRate(0.0)
        from .server import Server

        self._server = Server(self._commands, self._requests.put, settings.port)
        self.url = self._server.url
        self._thread = Thread(target=copy_context().run, args=(self._run,), name="simulator", daemon=True)
        self._thread.start()
        atexit.register(self.stop)  # the thread must not outlive the interpreter

    def _start_simulation(self, t: float, q: Array, v: Array, s: Array | None = None) -> None:
        """Start to simulate the mechanism with the current dimensions from a state, to which a reset returns."""
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
        self._submit({"parameter" if name in self._dimensions.values else "input": name, "value": value})

    def move(self, joint: str, value: float | None) -> None:
        """Pull a joint to a value in rad or m by a spring; None releases it.

        Raises:
            UnknownNameError: lists the joints with sliders.
            InputError: for a value that is not a finite number.
        """
        self._submit({"joint": joint, "value": value})

    def pull(self, frame: str, target: Sequence[float]) -> None:
        """Pull the origin of a frame to a point of the world in m, (3,), by a spring; `drop` releases it.

        Raises:
            UnknownNameError: lists the frames.
            InputError: for a frame of the ground, or a target that is not three finite numbers.
        """
        self._submit({"frame": frame, "to": list(target)})

    def drop(self) -> None:
        """Release the pulled point."""
        self._submit({"drop": True})

    def play(self, on: bool = True) -> None:
        """Continue or pause the simulation."""
        self._submit({"play": on})

    def reset(self) -> None:
        """Return to the start; the run so far is added to ``runs``."""
        self._submit({"reset": True})

    def _submit(self, request: dict[str, Any]) -> None:
        """Check a request, and queue it for the simulator's thread."""
        if self._stopping.is_set():
            raise InputError("the live view has ended")
        self._check(request)
        self._requests.put(request)

    def stop(self) -> "Solution":
        """End the view, and return the recorded run; the page reports the end."""
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
            self._process_requests()
            if self.playing:
                self._advance(speed / fps)
            self._q = self._simulator.q
            self._server.show(self._scene.frame(self._q, self._pulls.line), self._page_state())
            due += 1 / fps
            now = perf_counter()
            due = now if now - due > LATE else due
            self._rate.update(now, self.t, self.frames_drawn)
            if self._rate.slow and not self._scene.coarse:
                self._server.command(*self._scene.coarsen())
            self._stopping.wait(max(YIELD, due - now))  # the thread of the server needs time, too

    def _advance(self, dt: float) -> None:
        """Advance in substeps in which the spring forces are constant."""
        count = self._pulls.substeps(dt)
        try:
            for _ in range(count):
                self._pulls.apply(self._simulator)
                if self._simulator.advance(dt / count) == "event":
                    self.state, self.message = "paused", "the simulation has reached a terminal event"
                    return
        except Exception as e:  # the page reports it, and the record remains
            kind = "" if isinstance(e, MbdaeError) else f"{type(e).__name__}: "
            self.state, self.message = "stopped", f"{kind}{e}"

    def _process_requests(self) -> None:
        """Execute the requests since the last frame; of several values of a parameter only the last one."""
        requests: list[dict[str, Any]] = []
        with suppress(Empty):
            while True:
                requests.append(self._requests.get_nowait())
        last = {x["parameter"]: i for i, x in enumerate(requests) if isinstance(x.get("parameter"), str)}
        for i, request in enumerate(requests):
            if last.get(request.get("parameter"), i) != i:
                continue
            try:
                self._check(request)
                self._execute(request)
            except (MbdaeError, TypeError, ValueError, KeyError) as e:  # a page may send anything
                self.message = str(e)

    def _check(self, request: Mapping[str, Any]) -> None:
        self._dimensions.check(request)
        self._pulls.check(request)

    def _execute(self, request: dict[str, Any]) -> None:
        if "play" in request:
            playing = self.state != "running" if request["play"] is None else request["play"]
            if self.state != "stopped":
                self.state, self.message = "running" if playing else "paused", ""
        elif "reset" in request:
            self._reset()
        elif "parameter" in request:
            self._change(request["parameter"], request["value"])
        elif self.state != "stopped":
            self._pulls.execute(request, self._simulator, self._scene.bodies)

    def _change(self, name: str, value: float) -> None:
        """Continue with a new value of a parameter; the run so far is added to ``runs``, as by a reset."""
        old, coarse = self._simulator, self._scene.coarse
        q, v = self._dimensions.change(name, value, old.q, old.v)
        self._store_run()
        self._start_simulation(old.t, q, v, old.s)
        paths, self.message = self._dimensions.paths_or_reason(q, self._scene.extent)
        self._server.command(*(self._scene.coarsen() if coarse else self._scene.redraw()), *paths)
        self.state = "paused" if self.state == "stopped" else self.state

    def _store_run(self) -> None:
        if self._settings.record and self.t != self._simulator.start:
            self.runs.append(self._simulator.solution())

    def _reset(self) -> None:
        self._store_run()
        self._simulator.restore(self._start)
        self._pulls.release()
        self.state, self.message = "running" if self.state == "running" else "paused", ""
        self._server.command(*self._pulls.slider_values(self._simulator))

    def _page_state(self) -> dict[str, Any]:
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
        yield from self._dimensions.paths_or_reason(self._q, self._scene.extent)[0]
        yield from self._pulls.controls(self._simulator)
        yield from self._dimensions.controls()
