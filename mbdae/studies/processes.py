"""Runs of a comparison, here or in processes of their own."""

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from multiprocessing import get_context, parent_process
from typing import Any

from ..errors import InputError
from ..mechanism import Mechanism
from .comparison.comparison import Point
from .comparison.course import Course, Samples, Task

Stop = Callable[[], bool]
Submit = Callable[[Callable[..., Point], Sequence[tuple[Any, ...]]], Iterator[Point]]
_here: dict[str, Any] = {}  # of a worker process: the course, the reference, and the flag that stops it


def measured(course: Course, task: Task, reference: Samples, clock: bool, stop: Stop | None = None) -> Point:
    """Make a run and measure it; its time counts when ``clock`` says so."""
    sol = course.solve(task, stop)
    point = course.measure(task, sol, reference)
    return replace(point, times=(sol.stats["seconds"],)) if clock and point.success else point


def timed(course: Course, task: Task, point: Point, stop: Stop | None = None) -> Point:
    """Repeat a run for its time."""
    return replace(point, times=(*point.times, course.solve(task, stop).stats["seconds"]))


def measured_there(task: Task, clock: bool) -> Point:
    """`measured` in a worker."""
    return measured(_here["course"], task, _here["reference"], clock, _here["stop"])


def timed_there(task: Task, point: Point) -> Point:
    """`timed` in a worker."""
    return timed(_here["course"], task, point, _here["stop"])


@contextmanager
def pool(workers: int, course: Course, reference: Samples | None) -> Iterator[Submit]:
    """Give a function that makes calls in worker processes and yields the results as they come.

    When the block is left by an exception the workers give up at the end of the step they are in.

    Raises:
        InputError: for a mechanism that cannot be sent to another process.
    """
    context = get_context("spawn")
    flag = context.Event()
    light = replace(course, mechanism=_light(course.mechanism))
    try:
        pickle.dumps(light)
    except (pickle.PicklingError, AttributeError, TypeError) as e:
        raise InputError(f"{course.mechanism.title!r} cannot be sent to another process, use one worker: {e}") from None
    with ProcessPoolExecutor(workers, context, _prepare, (light, reference, flag)) as executor:

        def submit(function: Callable[..., Point], calls: Sequence[tuple[Any, ...]]) -> Iterator[Point]:
            for future in as_completed([executor.submit(function, *call) for call in calls]):
                yield future.result()

        try:
            yield submit
        except BaseException:
            flag.set()
            executor.shutdown(cancel_futures=True)
            raise


def leave_with_parent() -> None:
    """End this worker when the process that started it is gone, however that ended: nobody wants its results."""
    parent = parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _prepare(course: Course, reference: Samples | None, flag: Any) -> None:
    leave_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes: the parent decides and sets the flag
    _here.update(course=course, reference=reference, stop=flag.is_set)


def _light(mech: Mechanism) -> Mechanism:
    """The mechanism without its shapes, which can be hundreds of megabytes, and without what made it."""
    light = copy(mech)
    light.visuals = light.source = None
    light.__dict__.pop("scene", None)
    return light
