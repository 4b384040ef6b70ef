"""Workers for the runs of a study: threads, processes, or any executor of concurrent.futures."""

import os
import pickle
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context, parent_process
from queue import SimpleQueue
from typing import Any, NamedTuple

from .. import backend
from ..errors import InputError, MbdaeError, UnknownNameError

KINDS = ("threads", "processes")
AHEAD = 2  # queued runs per worker, so that none is idle
MOST = 10_000  # workers
OTHER = 64  # workers of an executor that does not report its number
Stop = Callable[[], bool]
Function = Callable[..., Any]  # (job, task, stop) -> result; stop is omitted where it is not available
_here: dict[str, Any] = {}  # of a worker process: the function, the shared job, and the stop flag


class Pool(NamedTuple):
    """Interface for submitting runs.

    Attributes:
        submit: submits a run, and returns its future.
        bound: largest number of submitted runs.
    """

    submit: Callable[[Any], Future]
    bound: int

    def work(self, tasks: Iterable[Any], keep: Callable[[Any, Any], None]) -> None:
        """Submit runs, a bounded number at a time, and call ``keep(task, result)`` as they finish.

        Raises:
            KeyboardInterrupt: after Ctrl-C, when finished results have been kept.
            MbdaeError: if a run is lost.
        """
        waiting, under_way, finished = iter(tasks), dict[Future, Any](), SimpleQueue[Future]()
        try:
            while True:
                for task in islice(waiting, self.bound - len(under_way)):
                    future = self.submit(task)
                    under_way[future] = task
                    future.add_done_callback(finished.put)
                if not under_way:
                    return
                future = finished.get()
                task = under_way.pop(future)
                keep(task, _result(future, task))
        except KeyboardInterrupt:
            for future, task in under_way.items():
                if not future.cancel() and future.done() and not future.cancelled() and not future.exception():
                    keep(task, future.result())
            raise


def _result(future: Future, task: Any) -> Any:
    try:
        return future.result()
    except MbdaeError:
        raise
    except (Exception, CancelledError) as e:
        why = f"{type(e).__name__}: {e}" if str(e) else type(e).__name__
        raise MbdaeError(f"{task} was lost by its worker, runs that are finished are kept: {why}") from e


@contextmanager
def pool(
    executor: str | Executor | None, workers: int | None, function: Function, job: Any, instead: str
) -> Iterator[Pool]:
    """Yield a pool of workers; a user's executor is not shut down.

    If the block ends by an exception, including Ctrl-C, running tasks stop at the end of their steps.

    Args:
        executor: ``"threads"``, ``"processes"``, or an executor; None for threads with the compiled core, which
            releases the GIL, and processes without it.
        workers: number of workers; one per processor when left out. For a user's executor: half the number of runs
            submitted at a time.
        function: makes a run, ``function(job, task, stop)``; stops when ``stop()`` is true.
        job: data shared by all runs; sent to each process once.
        instead: the arguments that avoid processes, for a message.

    Raises:
        UnknownNameError: for an unknown executor name.
        InputError: for a number of workers below 1 or above `MOST`, or a job that cannot be sent to another process.
    """
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or not 1 <= workers <= MOST):
        raise InputError(f"workers is a number of at least 1 and at most {MOST}, got {workers!r}")
    kind = default() if executor is None else executor
    count = workers or _processors()
    if kind == "threads":
        flag = threading.Event()
        with _left(ThreadPoolExecutor(count), flag) as threads:
            yield Pool(lambda task: threads.submit(function, job, task, flag.is_set), AHEAD * count)
        return
    if isinstance(kind, str) and kind != "processes":
        raise UnknownNameError("executor", kind, (*KINDS, "an executor of concurrent.futures"))
    try:
        sent = pickle.dumps((function, job))
    except (pickle.PicklingError, AttributeError, TypeError) as e:
        raise InputError(f"what is to be run cannot be sent to another process, use {instead}: {e}") from None
    if kind == "processes":
        context = get_context("spawn")
        event = context.Event()
        with _left(ProcessPoolExecutor(count, context, _prepare, (sent, event)), event) as processes:
            yield Pool(lambda task: _deaf(processes, task), AHEAD * count)
        return
    if not isinstance(kind, Executor):
        raise InputError(f"executor is one of {', '.join(KINDS)}, or one of concurrent.futures, got {kind!r:.60}")
    given: Executor = kind
    count = workers or getattr(given, "_max_workers", None) or OTHER
    yield Pool(lambda task: given.submit(function, job, task), AHEAD * count)


def default() -> str:
    """Threads with the compiled core, processes without it."""
    return "threads" if backend.load() is not None else "processes"


@contextmanager
def _left(executor: Any, flag: Any) -> Iterator[Any]:
    """Yield an executor and shut it down; if the block ends by an exception, its runs are stopped first."""
    try:
        yield executor
    except BaseException:
        flag.set()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _deaf(processes: ProcessPoolExecutor, task: Any) -> Future:
    """Submit a run to worker processes; a process started by it ignores Ctrl-C: the parent sets the flag."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by child processes
    try:
        return processes.submit(_run_here, task)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _prepare(sent: bytes, event: Any) -> None:
    """Initialise a worker process: imports happen after the exit handling is set up."""
    _leave_with_parent()
    warnings.filterwarnings("ignore", backend.SLOW_WARNING)  # issued once, by the parent
    function, job = pickle.loads(sent)
    _here.update(function=function, job=job, stop=event.is_set)


def _leave_with_parent() -> None:
    """End this worker when its parent process has ended, for whatever reason, since nobody needs its results."""
    parent = parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _run_here(task: Any) -> Any:
    return _here["function"](_here["job"], task, _here["stop"])
