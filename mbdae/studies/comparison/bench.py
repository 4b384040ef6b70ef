"""The runs of a comparison: what is finished, the file that keeps it, and the order in which the rest is done."""

import hashlib
import json
import platform
import sys
from collections.abc import Callable
from pathlib import Path

from ...errors import InputError
from ...mechanism import describe
from ...solution.archive import versions
from ..processes import measured, measured_there, pool, timed, timed_there
from ..variant import Variant
from .comparison import Comparison, Point, in_order
from .course import Course, Samples, Task

LONG = 2.0  # s: a run that takes longer is timed once
Progress = Callable[[float, str], None]


class Bench:
    """The runs of a comparison, those that are finished, and the file that keeps them.

    Args:
        course: what is computed.
        tasks: the runs.
        pair: methods of the reference.
        rtol: their tolerance.
        path: the file, if any; it is read when it exists.
        progress: see `mbdae.compare`.
        passes: how often each run will be made.
        fresh: leave the file unread.

    Raises:
        InputError: for a file with another comparison.
    """

    def __init__(
        self,
        course: Course,
        tasks: list[Task],
        pair: list[Variant],
        rtol: float,
        path: Path | None,
        progress: Progress | None,
        passes: int,
        fresh: bool = False,
    ) -> None:
        self.course, self.tasks, self.pair, self.rtol, self.path = course, tasks, pair, rtol, path
        self.tell: Progress = progress or (lambda done, name: None)
        self.passes, self.passed = passes, 0
        self.points: dict[tuple, Point] = {}
        self.reference, self.witness = "", ""
        self.uncertainty: dict[str, float] = {}
        self.samples: Samples | None = None
        machine = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
        about = {"versions": versions(), "command": sys.argv, "machine": machine, "backend": course.backend}
        self.meta = {"key": self.key(), **about}
        if path and path.exists() and not fresh:
            self._read(path)

    def key(self) -> str:
        """What two comparisons must share to have points in common: mechanism, start, times, reference, version."""
        c = self.course
        what = (
            describe(c.mechanism), c.q.tolist(), c.v.tolist(), c.t_span, c.times.tolist(), [str(v) for v in self.pair],
            self.rtol, c.max_steps, c.backend, versions()["mbdae"],
        )  # fmt: skip
        return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()

    def _read(self, path: Path) -> None:
        old = Comparison.load(path)
        if old.meta.get("key") != self.key():
            what = "another mechanism, span, reference or version of mbdae"
            raise InputError(f"{path} holds a comparison of {what}: name another file, or start afresh")
        self.points = {p.label: p for p in old.points}
        self.reference, self.witness, self.uncertainty = old.reference, old.witness, old.uncertainty

    def open(self) -> list[Task]:
        """Runs that were not made yet."""
        return [t for t in self.tasks if t.label not in self.points]

    def refer(self) -> None:
        """Compute the reference, if any run is still to be held against it."""
        if self.open():
            self.tell(0.0, "reference")
            runs, self.samples, u = self.course.reference(self.pair, self.rtol)
            self.reference, self.witness = str(runs[0]), str(runs[1])
            self.uncertainty = dict(zip(("q", "v", "lam"), u.tolist(), strict=True))

    def measure(self, workers: int, *, clock: bool) -> None:
        """Make the runs that are missing, here or in processes."""
        todo = self.open()
        if self.samples is None or not todo:
            return
        if workers == 1:
            for i, task in enumerate(todo):
                self._say(i / len(todo), str(task))
                self._keep(measured(self.course, task, self.samples, clock))
        else:
            with pool(workers, self.course, self.samples) as submit:
                for i, done in enumerate(submit(measured_there, [(t, clock) for t in todo])):
                    self._say((i + 1) / len(todo), f"{done.method} done")
                    self._keep(done)
        self.passed += 1

    def time(self, repeats: int, workers: int) -> None:
        """Repeat runs for their times, all of them in turn; those above two seconds once."""
        labels = {t.label: t for t in self.tasks}
        for r in range(repeats):
            short = [(labels[k], p) for k, p in self.points.items() if k in labels and len(p.times) <= r and _again(p)]
            if not short:
                continue
            if workers == 1:
                for i, (task, point) in enumerate(short):
                    self._say(i / len(short), f"time {r + 1} of {repeats}: {task}")
                    self._keep(timed(self.course, task, point))
            else:
                with pool(workers, self.course, None) as submit:
                    for i, done in enumerate(submit(timed_there, short)):
                        self._say((i + 1) / len(short), f"time {r + 1} of {repeats}")
                        self._keep(done)
            self.passed += 1

    def _say(self, share: float, name: str) -> None:
        """Tell the progress: so many passes over the runs are done, and a share of the next one."""
        self.tell(min(1.0, (self.passed + share) / self.passes), name)

    def _keep(self, point: Point) -> None:
        self.points[point.label] = point
        if self.path:
            self._comparison(list(self.points), complete=False).save(self.path)

    def result(self, complete: bool) -> Comparison:
        """What was finished of the runs asked for; the file also keeps what it held before."""
        if complete and self.path:
            self._comparison(list(self.points), complete=True).save(self.path)
        return self._comparison([], complete)

    def _comparison(self, more: list[tuple], complete: bool) -> Comparison:
        c, labels = self.course, [t.label for t in self.tasks]
        points = in_order(self.points.values(), list(dict.fromkeys([*labels, *more])))
        about = (self.reference, self.witness, self.uncertainty)
        return Comparison(c.mechanism.title, c.t_span, points, *about, complete, self.meta)


def _again(point: Point) -> bool:
    return point.success and not (point.times and point.times[0] > LONG)
