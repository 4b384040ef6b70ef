"""Workers for the runs of a study: threads, processes, or any executor of concurrent.futures."""

import os
import pickle
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import islice
from multiprocessing import get_context, parent_process
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np

from .. import backend
from ..errors import InputError, MbdaeError, UnknownNameError, is_count

KINDS = ("threads", "processes")
QUEUED_PER_WORKER = 2  # number of submitted runs per worker, so that none is idle
SHORTEST_BATCH = 0.02  # s, ten times the time to prepare a batch
MAX_WORKERS = 10_000
UNKNOWN_EXECUTOR_WORKERS = 64  # assumed for an executor that does not report its number of workers
Stop = Callable[[], bool]
Function = Callable[..., Any]  # (job, task, stop) -> result; custom executors call it without stop
_worker: dict[str, Any] = {}  # in a worker process: the function, the shared job, and the stop flag


class StopFlag:
    """A flag that workers, also threads of the compiled core, check while they compute.

    Args:
        shared: one byte, which processes may share.

    Attributes:
        memory: 1 after `set`, of type uint8, (1,).
    """

    def __init__(self, shared: Any = None) -> None:
        self.memory = np.frombuffer(bytearray(1) if shared is None else shared, np.uint8)

    def set(self) -> None:
        """Request all runs to stop."""
        self.memory[0] = 1

    def __call__(self) -> bool:
        """Return whether runs must stop."""
        return bool(self.memory[0])


def stop_check(stop: Stop | None) -> Callable[[float], None] | None:
    """Return a function of the progress of a run that interrupts it when ``stop()`` is true; None without ``stop``."""
    if stop is None:
        return None

    def check(done: float) -> None:
        if stop():
            raise KeyboardInterrupt

    return check


def batch_size(remaining: int, pending: int, seconds: float | None) -> int:
    """Return the number of runs of the next batch.

    Batches shorten towards the end, so that all workers are busy until then, but not below `SHORTEST_BATCH`.

    Args:
        remaining: number of runs that are in no batch yet.
        pending: number of batches that are submitted at a time.
        seconds: wall time of a run; None if none has finished.
    """
    shortest = int(SHORTEST_BATCH / seconds) if seconds else 1
    return min(remaining, max(1, shortest, remaining // (2 * pending)))


class Pool(NamedTuple):
    """Interface for submitting runs.

    Attributes:
        submit: submits a run, and returns its future.
        workers: returns the current number of workers.
    """

    submit: Callable[[Any], Future]
    workers: Callable[[], int]

    @property
    def max_pending(self) -> int:
        """Largest number of submitted runs that have not finished."""
        return QUEUED_PER_WORKER * self.workers()

    def run(self, tasks: Iterable[object], store: Callable[[Any, Any], None]) -> None:
        """Submit runs, a bounded number at a time, and call ``store(task, result)`` as they finish.

        Raises:
            KeyboardInterrupt: after Ctrl-C, when finished results have been stored.
            MbdaeError: if a worker fails or is terminated.
        """
        waiting, pending, finished = iter(tasks), dict[Future, Any](), SimpleQueue[Future]()
        try:
            while True:
                for task in islice(waiting, self.max_pending - len(pending)):
                    future = self.submit(task)
                    pending[future] = task
                    future.add_done_callback(finished.put)
                if not pending:
                    return
                future = finished.get()
                task = pending.pop(future)
                store(task, _result(future, task))
        except KeyboardInterrupt:
            for future, task in pending.items():
                if not future.cancel() and future.done() and not future.cancelled() and not future.exception():
                    store(task, future.result())
            raise


def _result(future: Future, task: object) -> Any:
    try:
        return future.result()
    except MbdaeError:
        raise
    except (Exception, CancelledError) as e:
        reason = f"{type(e).__name__}: {e}" if str(e) else type(e).__name__
        raise MbdaeError(f"{task} failed in its worker, finished runs are stored: {reason}") from e


@contextmanager
def pool(
    executor: str | Executor | None, workers: int | None, function: Function, job: object, alternative: str
) -> Iterator[Pool]:
    """Yield a pool of workers; a user's executor is not shut down.

    If the block raises, also by Ctrl-C, running tasks stop at the end of their current steps.

    Args:
        executor: ``"threads"``, ``"processes"``, or an executor; None for threads with the compiled core, which
            releases the GIL, and processes without it.
        workers: number of workers; when left out one per processor, or the number that a user's executor reports.
        function: executes a run, ``function(job, task, stop)``; stops when ``stop()`` is true.
        job: data shared by all runs; sent to each process once.
        alternative: arguments that avoid processes, for the error message.

    Raises:
        UnknownNameError: for an unknown executor name.
        InputError: for a number of workers below 1 or above `MAX_WORKERS`, or a job that cannot be pickled.
    """
    if workers is not None and not (is_count(workers) and workers <= MAX_WORKERS):
        raise InputError(f"workers is a number of at least 1 and at most {MAX_WORKERS}, got {workers!r}")
    default = "processes" if backend.load() is None else "threads"
    kind = default if executor is None else executor
    count = workers or _processors()
    if kind == "threads":
        flag = StopFlag()
        with _shut_down_after(ThreadPoolExecutor(count), flag) as threads:
            yield Pool(lambda task: threads.submit(function, job, task, flag), lambda: count)
        return
    if isinstance(kind, str) and kind != "processes":
        raise UnknownNameError("executor", kind, (*KINDS, "an executor of concurrent.futures"))
    try:
        sent = pickle.dumps((function, job))
    except (pickle.PicklingError, AttributeError, TypeError) as e:
        raise InputError(f"the runs cannot be sent to another process, use {alternative}: {e}") from None
    if kind == "processes":
        context = get_context("spawn")
        shared = context.RawArray("B", 1)
        executor = ProcessPoolExecutor(count, context, _initialize_worker, (sent, shared))
        with _shut_down_after(executor, StopFlag(shared)) as processes:
            yield Pool(lambda task: _submit_ignoring_sigint(processes, task), lambda: count)
        return
    if not isinstance(kind, Executor):
        raise InputError(f"executor is one of {', '.join(KINDS)}, or one of concurrent.futures, got {kind!r:.60}")
    user_executor: Executor = kind
    submit = partial(user_executor.submit, function, job)
    yield Pool(submit, lambda: workers or _number_of_workers(user_executor))


def _number_of_workers(executor: Any) -> int:
    """Return the current number of workers of a user's executor."""
    threads = getattr(getattr(executor, "_client", None), "nthreads", None)  # of Dask, whose clusters grow
    known = sum(threads().values()) if threads else getattr(executor, "_max_workers", None)
    return known or UNKNOWN_EXECUTOR_WORKERS


@contextmanager
def _shut_down_after(executor: Any, flag: StopFlag) -> Iterator[Any]:
    """Yield an executor and shut it down; if the block raises, stop its runs first."""
    try:
        yield executor
    except BaseException:
        flag.set()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _submit_ignoring_sigint(processes: ProcessPoolExecutor, task: object) -> Future:
    """Submit a run; worker processes started by it ignore Ctrl-C, since the parent sets the stop flag."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by child processes
    try:
        return processes.submit(_run_in_worker, task)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _initialize_worker(sent: bytes, shared: Any) -> None:
    """Initialize a worker process: imports happen after the exit handling is set up."""
    _exit_with_parent()
    warnings.filterwarnings("ignore", backend.SLOW_WARNING)  # issued once, by the parent
    function, job = pickle.loads(sent)
    _worker.update(function=function, job=job, stop=StopFlag(shared))


def _exit_with_parent() -> None:
    """End this worker process when its parent ends for any reason."""
    parent = parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _run_in_worker(task: object) -> Any:
    return _worker["function"](_worker["job"], task, _worker["stop"])
