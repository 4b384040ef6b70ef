"""Where the runs of a sweep are computed: threads, processes, or any executor of concurrent.futures."""

import os
import pickle
import signal
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, NamedTuple

from ... import backend
from ...errors import InputError, UnknownNameError
from ..processes import leave_with_parent
from .plan import Task
from .run import Job, Stop, run

KINDS = ("threads", "processes")
AHEAD = 2  # runs under way for each worker, so that none waits for the next
MOST = 10_000  # workers
OTHER = 64  # workers of an executor that does not say how many it has
_here: dict[str, Stop] = {}  # of a worker process: the flag that stops it


class Pool(NamedTuple):
    """Computes runs.

    Attributes:
        submit: gives a run away, and returns its future.
        bound: how many may be under way.
        stop: makes the runs under way give up, as far as they can be reached.
    """

    submit: Callable[[Task], Future]
    bound: int
    stop: Callable[[], None]


@contextmanager
def pool(executor: str | Executor | None, workers: int | None, job: Job) -> Iterator[Pool]:
    """Give a pool of workers; an executor of the user is left open.

    Args:
        executor: ``"threads"``, ``"processes"``, or an executor; None for threads with the compiled core, which
            computes without holding up other threads, and processes without it.
        workers: how many; one for each processor when left out. An executor of the user has its own: it gets so many
            runs at a time, twice.
        job: what the runs share.

    Raises:
        UnknownNameError: for another kind.
        InputError: for a number of workers below 1 or above `MOST`, or what cannot be sent to another process.
    """
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or not 1 <= workers <= MOST):
        raise InputError(f"workers is a number of at least 1 and at most {MOST}, got {workers!r}")
    kind = default() if executor is None else executor
    count = workers or _processors()
    if kind == "threads":
        flag = threading.Event()
        with _left(ThreadPoolExecutor(count), flag.set) as threads:
            yield Pool(lambda task: threads.submit(run, job, task, flag.is_set), AHEAD * count, flag.set)
        return
    if isinstance(kind, str) and kind != "processes":
        raise UnknownNameError("executor", kind, (*KINDS, "an executor of concurrent.futures"))
    try:
        pickle.dumps(job)
    except (pickle.PicklingError, AttributeError, TypeError) as e:
        raise InputError(f"the sweep cannot be sent to another process, use executor='threads': {e}") from None
    if kind == "processes":
        backend.choose(job.settings.get("backend", "auto"))  # its warning is said here, once, and not by every worker
        context = get_context("spawn")
        event = context.Event()
        with _left(ProcessPoolExecutor(count, context, _prepare, (event,)), event.set) as processes:
            yield Pool(lambda task: _deaf(processes, job, task), AHEAD * count, event.set)
        return
    if not isinstance(kind, Executor):
        raise InputError(f"executor is one of {', '.join(KINDS)}, or one of concurrent.futures, got {kind!r:.60}")
    given: Executor = kind
    count = workers or getattr(given, "_max_workers", None) or OTHER
    yield Pool(lambda task: given.submit(run, job, task), AHEAD * count, lambda: None)


def default() -> str:
    """Threads with the compiled core, processes without it."""
    return "threads" if backend.load() is not None else "processes"


@contextmanager
def _left(executor: Any, stop: Callable[[], None]) -> Iterator[Any]:
    """An executor that is shut down; when the block is left by an error its runs give up first."""
    try:
        yield executor
    except BaseException:
        stop()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _deaf(processes: ProcessPoolExecutor, job: Job, task: Task) -> Future:
    """Give a run to worker processes; one that begins with it is deaf to Ctrl-C: the parent sets the flag."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return processes.submit(_run_here, job, task)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _prepare(event: Any) -> None:
    leave_with_parent()
    warnings.filterwarnings("ignore", backend.SLOW)
    _here["stop"] = event.is_set


def _run_here(job: Job, task: Task) -> dict[str, Any]:
    return run(job, task, _here["stop"])
