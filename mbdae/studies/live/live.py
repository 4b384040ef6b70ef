"""A simulated mechanism in a browser, in real time: sliders for its inputs and joints, and points that are pulled."""

import atexit
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from ...errors import InputError, MbdaeError
from ...integrate.options.options import require_positive
from ...integrate.simulator.simulator import Simulator
from ...solution.problem import mechanism_of
from ...system import Array
from ...tolerances import INPUT_DIGITS
from .frame_rate import FrameRate
from .live_scene import LiveScene
from .pulls import Pulls

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...solution.solution import Solution

__all__ = ["live"]

YIELD = 0.002  # s between frames
LATE = 0.25  # s behind real time, after which the view is slower than real time
NOTICED = 0.1  # deviation from real time that is shown


class _ViewSettings(NamedTuple):  # see `live`
    speed: float
    fps: float
    port: int | None
    play: bool
    record: bool
    shadows: bool


class LiveView:
    """A running live view; shown in notebooks, and a context that closes it.

    Attributes:
        url: address of the page.
        mechanism: the simulated mechanism, with the inputs of `mbdae.live`.
        playing: whether time passes.
        state: ``"running"``, ``"paused"``, or ``"stopped"`` after a failed step.
        message: why it has stopped.
        runs: the recorded solutions before the last reset.
    """

    def __init__(self, mechanism: "Mechanism", pulls: Pulls, simulator: Simulator, settings: "_ViewSettings") -> None:
        self.mechanism, self._pulls, self._simulator, self._settings = mechanism, pulls, simulator, settings
        self.state, self.message = "running" if settings.play else "paused", ""
        self.runs: list[Solution] = []
        self._orders: SimpleQueue[dict[str, Any]] = SimpleQueue()
        self._stopping, self._rate = Event(), FrameRate(simulator.t)
        self._start, self._q = simulator.save(), simulator.q
        self._scene = LiveScene(mechanism.scene, self._q, settings.shadows)
        from .server import Server

        self._server = Server(self._commands, self._orders.put, settings.port)
        self.url = self._server.url
        self._thread = Thread(target=self._run, name="simulator", daemon=True)
        self._thread.start()
        atexit.register(self.stop)  # the thread must not outlive the interpreter

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
        """Set an input, as its slider does.

        Raises:
            UnknownNameError: lists the inputs.
            InputError: for a value that is not a finite number.
        """
        self._do({"input": name, "value": value})

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
        self._pulls.check(order)
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
        """Do what pages and callers have ordered since the last frame."""
        while True:
            try:
                order = self._orders.get_nowait()
            except Empty:
                return
            try:
                self._pulls.check(order)
                self._act(order)
            except (MbdaeError, TypeError, ValueError, KeyError) as e:  # a page may send anything
                self.message = str(e)

    def _act(self, order: dict[str, Any]) -> None:
        if "play" in order:
            playing = self.state != "running" if order["play"] is None else order["play"]
            if self.state != "stopped":
                self.state, self.message = "running" if playing else "paused", ""
        elif "reset" in order:
            self._reset()
        elif self.state != "stopped":
            self._pulls.order(order, self._simulator, self._scene.bodies)

    def _reset(self) -> None:
        if self._settings.record and self.t != self._simulator.start:
            self.runs.append(self._simulator.solution())
        self._simulator.restore(self._start)
        self._pulls.release()
        self.state, self.message = "running" if self.state == "running" else "paused", ""
        self._server.command(*self._pulls.slider_values(self._simulator))

    def _described(self) -> dict[str, Any]:
        """Return the state for the pages, as text and data."""
        text = f"{self.mechanism.title}\nt = {self.t:.2f} s"
        slow = self.playing and abs(self._rate.pace - 1) > NOTICED and f" ({self._rate.pace:.2g} of real time)"
        text += slow or ("" if self.playing else f", {self.state}")
        text += f"\n{self.message}" if self.message else ""
        page = {"camera": self._scene.camera, "coarse": self._scene.coarse}
        return {"text": text, "t": self.t, "state": self.state, "wrong": self.state == "stopped", **page}

    def _commands(self) -> Iterator[dict[str, Any]]:
        """Yield the commands that draw the scene and the controls for a new page."""
        yield from self._scene.commands()
        yield from self._scene.frame(self._q, self._pulls.line)
        yield from self._pulls.controls(self._simulator)


def live(
    model: "Mechanism | str | Path",
    *,
    method: str | None = None,
    step: float | None = None,
    rtol: float | None = None,
    speed: float = 1.0,
    fps: float = 60.0,
    ranges: Mapping[str, Sequence[float]] | None = None,
    port: int | None = None,
    paused: bool = False,
    shadows: bool = False,
    record: bool = True,
) -> LiveView:
    """Simulate a mechanism in real time, and show it in a browser with sliders for its inputs and joints.

    The page is meshcat's, served on this computer. The slider of an input sets it; that of a joint pulls the joint by
    a critically damped spring of 20 rad/s; a drag that begins on a body pulls its point,

        f = m (w^2 (target - p) - 2 w p').

    Args:
        model: a mechanism, or the name or path of one.
        method: name of a method; the model's own if omitted.
        step: fixed step in s; controlled if omitted.
        rtol: relative tolerance of controlled steps; 1e-6 if omitted.
        speed: seconds of motion per second.
        fps: frames per second at most.
        ranges: (low, high) of sliders, by the name of an input or joint; limits of joints, or wide ones if omitted.
        port: of the page; a free one from 7000 on if omitted.
        paused: whether no time passes until it is started in the page.
        shadows: whether bodies cast shadows, which takes time to draw.
        record: whether all steps are kept for `LiveView.stop`; otherwise memory does not grow.

    Returns:
        The running view, with its ``url``; `LiveView.stop` ends it.

    Raises:
        UnknownNameError: for an unknown method, or a range of something unknown.
        InputError: for wrong arguments, a start that cannot be simulated, or a port in use.

    Example:
        >>> view = mbdae.live("slider_crank")   # doctest: +SKIP
        >>> sol = view.stop()   # doctest: +SKIP
    """
    require_positive(speed=speed, fps=fps)
    mech = mechanism_of(model, "live")
    pulls = Pulls(mech, mech.start[0], ranges or {})
    rtol = INPUT_DIGITS if rtol is None and step is None else rtol
    simulator = Simulator(pulls.mechanism, record=record, method=method, step=step, rtol=rtol)
    return LiveView(pulls.mechanism, pulls, simulator, _ViewSettings(speed, fps, port, not paused, record, shadows))
