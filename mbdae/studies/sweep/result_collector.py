"""Collection of the results of a sweep as its batches finish."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from .plan import Runs
from .results_file import SweepFile, join_results, results_of
from .sweep_batch import FinishedRuns
from .table import Sweep

Progress = Callable[[float, str], None]


class ResultCollector:
    """Results of finished runs of a sweep: in memory, and in a file if a path is given.

    Args:
        meta: metadata of the table, see `mbdae.Sweep`.
        path: path of the file, whose runs are not repeated.
        fresh: replace an existing file without reading it.
        progress: called with the completed fraction and a message.

    Attributes:
        done: run numbers of the finished runs.
        seconds: wall times in s of the runs that finished in this call, by run number.
    """

    def __init__(self, meta: dict[str, Any], path: Path | None, fresh: bool, progress: Progress | None) -> None:
        self.file = None if path is None else SweepFile(path, meta["kinds"], meta, fresh)
        self.meta, self.path, self.progress = meta, path, progress
        self.results = [self.file.results if self.file else results_of([])]
        self.done, self.seconds = {*self.results[0]["run"]}, dict[int, float]()

    def record(self, batch: Runs, found: Sequence[FinishedRuns]) -> None:
        """Record the results and wall times of completed or failed runs of a batch, and report the progress."""
        if self.file and found:
            self.file.append(join_results([x.results for x in found]))
        for results, seconds in found:
            self.results.append(results)
            self.done |= {*results["run"]}
            self.seconds |= dict.fromkeys(results["run"], seconds)
        if self.progress:
            n, total = len(self.done), self.meta["manifest"]["runs"]
            self.progress(n / total, f"{n} of {total} runs")

    def finish(self) -> Sweep:
        """Return the table of finished runs; write the file if all are finished."""
        result = Sweep(join_results(self.results), self.meta, self.seconds, self.path)
        if self.file and result.complete:
            self.file.finish(result.results)
        return result

    def close(self) -> None:
        """Close the file."""
        if self.file:
            self.file.close()
