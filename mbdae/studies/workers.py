"""Workers that make the runs of a study: threads, processes, or any executor of concurrent.futures."""

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
AHEAD = 2  # runs under way for each worker, so that none waits for the next
MOST = 10_000  # workers
OTHER = 64  # workers of an executor that does not say how many it has
Stop = Callable[[], bool]
Function = Callable[..., Any]  # (job, task, stop) -> result; stop is left out where it cannot be reached
_here: dict[str, Any] = {}  # of a worker process: the function, what all runs share, and the flag that stops them


class Pool(NamedTuple):
    """Makes runs.

    Attributes:
        submit: gives a run away, and returns its future.
        bound: how many may be under way.
    """

    submit: Callable[[Any], Future]
    bound: int

    def work(self, tasks: Iterable[Any], keep: Callable[[Any, Any], None]) -> None:
        """Make runs, a bounded number under way, and call ``keep(task, result)`` as they finish.

        Raises:
            KeyboardInterrupt: after Ctrl-C, when those that are finished are kept.
            MbdaeError: when a run does not come back.
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
    """Give a pool of workers; an executor of the user is left open.

    When the block is left by an exception, Ctrl-C among them, the runs under way give up at the end of their steps.

    Args:
        executor: ``"threads"``, ``"processes"``, or an executor; None for threads with the compiled core, which
            computes without holding up other threads, and processes without it.
        workers: how many; one for each processor when left out. An executor of the user has its own: it gets so many
            runs at a time, twice.
        function: makes a run, ``function(job, task, stop)``; gives up when ``stop()`` says so.
        job: what the runs share; a process gets it once.
        instead: the arguments that do without other processes, for a message.

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
    """An executor that is shut down; when the block is left by an exception its runs give up first."""
    try:
        yield executor
    except BaseException:
        flag.set()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _deaf(processes: ProcessPoolExecutor, task: Any) -> Future:
    """Give a run to worker processes; one that begins with it is born deaf to Ctrl-C: the parent sets the flag."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # a child inherits what is blocked
    try:
        return processes.submit(_run_here, task)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _prepare(sent: bytes, event: Any) -> None:
    """Begin as a worker process: what it computes is imported only when it knows how to end."""
    _leave_with_parent()
    warnings.filterwarnings("ignore", backend.SLOW)  # said once, by the parent
    function, job = pickle.loads(sent)
    _here.update(function=function, job=job, stop=event.is_set)


def _leave_with_parent() -> None:
    """End this worker when the process that started it is gone, however that ended: nobody wants its results."""
    parent = parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _run_here(task: Any) -> Any:
    return _here["function"](_here["job"], task, _here["stop"])
