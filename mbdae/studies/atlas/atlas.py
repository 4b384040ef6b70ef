"""Benchmark of all methods on many models, an *atlas* of integrators: errors, work, drift and energy."""

import warnings
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ...backend import machine_description, select_core
from ...discovery import model_names
from ...errors import InputError, as_list
from ...mechanism.formats.model_library import find
from ...solution.provenance import command_line, versions
from ..comparison.selection import ALL, checked_steps, checked_tolerances
from ..method_variant import variants
from ..workers import Stop, pool
from .data_file import BenchmarkData
from .method_runs import MethodRuns, MethodTask
from .model_motion import ModelMotion, MotionTask, Settings
from .result import Benchmark

__all__ = ["atlas"]

TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
REFINEMENTS = (1, 4, 16, 64)
REFERENCES_DONE = 0.1  # fraction of the progress once the references are computed
Progress = Callable[[float, str], None]


def atlas(
    models: str | Iterable[str] | None = None,
    *,
    methods: str | Iterable[str] | None = None,
    rtol: Sequence[float] | None = None,
    refinements: Sequence[int] | None = None,
    data: str | Path | None = None,
    executor: str | Executor = "processes",
    workers: int | None = None,
    fresh: bool = False,
    backend: str = "auto",
    progress: Progress | None = None,
) -> Benchmark:
    """Benchmark all methods on many models, from their starts over their durations: errors, work, drift and energy.

    Errors are those of `mbdae.compare`, at 20 common times, relative to a reference run with tight tolerance. Methods
    run with tolerances, or with fixed steps if they have no step-size control. Conservative models also run over ten
    durations with fixed steps, half as long as the coarsest ones, for the trend of their energy. Times are CPU times.

    With ``data`` each finished result is stored, and the same call resumes from the file; with more models or methods
    it computes what is missing. After Ctrl-C it returns the finished results.

    Args:
        models: names, or paths of mechanism files. All that come with mbdae when left out.
        methods: names, also with a formulation, ``"ggl:radau5"``. All when left out, or ``"all"``.
        rtol: relative tolerances, 1e-3 to 1e-8 when left out. The tighter ones are omitted after an error that is
            below five times the uncertainty of the reference, or a run of more than 20000 linear solves.
        refinements: numbers of fixed steps as multiples of that of ``radau5`` at rtol 1e-3; 1, 4, 16, 64 when left out.
        data: file of the results, .jsonl. The same command resumes from it.
        executor: ``"processes"``, ``"threads"`` or any executor of concurrent.futures; scripts with processes need
            ``if __name__ == "__main__":``.
        workers: processes or threads; one per processor when left out.
        fresh: do not resume from the file, but replace it.
        backend: back end of all runs. ``"auto"`` takes the compiled core, or Python without it. Methods and models that
            it does not support are listed with the reason.
        progress: called with the completed fraction and a message.

    Raises:
        UnknownNameError: for an unknown model, method, back end or executor.
        InputError: for wrong arguments; for a file of another back end, machine, version or settings, or a model that
            has changed since.
        MbdaeError: if a worker fails; finished results are stored.
    """
    names = list(dict.fromkeys(model_names() if models is None else as_list(models, "models is a list of names")))
    if not names:
        raise InputError("an atlas needs at least one model")
    for name in names:
        find(name)
    chosen = [] if methods is None or as_list(methods, "methods is a list of names") == [ALL] else variants(methods)
    settings = Settings(
        tuple(map(str, chosen)),
        tuple(checked_tolerances(TOLERANCES if rtol is None else rtol)),
        tuple(checked_steps(REFINEMENTS if refinements is None else refinements, "refinements")),
        "native" if select_core(backend) else "python",
    )
    about = {
        "backend": settings.backend, "machine": machine_description(), "versions": versions(),
        "rtol": list(settings.rtol), "refinements": list(settings.refinements),
    }  # fmt: skip
    if data is not None and not isinstance(data, str | Path):
        raise InputError(f"data is the name of a file, got {data!r:.60}")
    tasks = _BenchmarkTasks(BenchmarkData(Path(data) if data else None, about, fresh), names, settings, progress)
    with suppress(KeyboardInterrupt), pool(executor, workers, compute, settings, "executor='threads'") as workers_pool:
        workers_pool.run(tasks.motion_tasks(), tasks.add)
        workers_pool.run(tasks.pending_tasks(), tasks.add)
    return tasks.result({**about, "command": command_line(), "date": datetime.now(UTC).date().isoformat()})


def compute(settings: Settings, task: Any, stop: Stop | None = None) -> Any:
    """Run a task in a worker, without Python warnings: the results contain them as messages."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return task.run(settings, stop)


class _BenchmarkTasks:
    """Tasks of a benchmark and their results."""

    def __init__(self, data: BenchmarkData, names: list[str], settings: Settings, progress: Progress | None) -> None:
        self.data, self.names, self.settings = data, names, settings
        self.progress: Progress = progress or (lambda done, text: None)
        self.seen: set[str] = set()  # models whose motion is known to be current

    def motion_tasks(self) -> list[MotionTask]:
        """Return the tasks of all motions: models of stored motions may have changed, too."""
        return [MotionTask(name, self.data.motions.get(name)) for name in self.names]

    def model_methods(self) -> list[tuple[str, str]]:
        """Return the models and methods of all runs."""
        motions = [self.data.motions[name] for name in self.names if name in self.data.motions]
        return [(m.model, method) for m in motions for method in m.methods]

    def pending_tasks(self) -> list[MethodTask]:
        """Return the tasks of methods without results."""
        motions, runs, pairs = self.data.motions, self.data.runs, self.model_methods()
        return [MethodTask(motions[model], method) for model, method in pairs if (model, method) not in runs]

    def add(self, task: Any, result: ModelMotion | MethodRuns) -> None:
        """Store a result, and report the progress."""
        self.data.add(result)
        if isinstance(task, MotionTask):
            self.seen.add(task.model)
            self.progress(REFERENCES_DONE * len(self.seen) / len(self.names), str(task))
        else:
            pairs = self.model_methods()
            done = sum(pair in self.data.runs for pair in pairs)
            self.progress(REFERENCES_DONE + (1 - REFERENCES_DONE) * done / len(pairs), str(task))

    def result(self, meta: dict[str, Any]) -> Benchmark:
        """Return the finished results."""
        motions = tuple(self.data.motions[name] for name in self.names if name in self.data.motions)
        runs = tuple(self.data.runs[key] for key in self.model_methods() if key in self.data.runs)
        complete = len(self.seen) == len(self.names) and len(runs) == len(self.model_methods())
        return Benchmark(motions, runs, complete, len(self.names), len(self.model_methods()), meta)
