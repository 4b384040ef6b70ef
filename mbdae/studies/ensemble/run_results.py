"""Results of the runs of an ensemble, as rows of arrays."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ...errors import STATUS, AssemblyError, InputError, MbdaeError
from ...integrate.run.core_runs import COUNTS, CoreRuns
from ...mechanism import Mechanism
from ...system import Array

UNFINISHED = "interrupted"


@dataclass
class RunResults:
    """Results of n runs, by rows; threads write different rows.

    Attributes:
        t: end times, (n,).
        y: end points, (n, ...).
        counts: numbers of steps and evaluations by `COUNTS`, (n, 10).
        drift: largest |g|, (n,).
        signals: values at the end, (n, k).
        status: status of each run.
        message: message of each run.
        reasons: why each run is deferred to `mbdae.solve`; "" if it is not.
    """

    t: Array
    y: Array
    counts: Array
    drift: Array
    signals: Array
    status: list[str]
    message: list[str]
    reasons: list[str]

    @classmethod
    def of(cls, mech: Mechanism, n: int, names: tuple[str, ...]) -> "RunResults":
        """Return the results of n runs that have not begun."""
        length = mech.nq + mech.nv + len(mech.states) + 1
        y, values = np.full((n, length), np.nan), np.full((n, len(names)), np.nan)
        counts, missing = np.zeros((n, len(COUNTS)), int), np.full(n, np.nan)
        texts = ([text] * n for text in (UNFINISHED, STATUS[UNFINISHED], ""))
        return cls(missing, y, counts, missing.copy(), values, *texts)

    def fail(self, i: Array, error: Exception) -> None:
        """Record runs that could not begin, with the statuses of a sweep."""
        invalid = "input" if isinstance(error, InputError) else "error"
        status = "assembly" if isinstance(error, AssemblyError) else invalid
        for k in i.tolist():
            self.status[k], self.message[k], self.reasons[k] = status, str(error), ""

    @contextmanager
    def recording_errors(self, i: Array) -> Iterator[None]:
        """Record an error of the block as that of these runs."""
        try:
            yield
        except MbdaeError as e:
            self.fail(i, e)

    def defer(self, i: Array, reason: str) -> None:
        """Defer runs to `mbdae.solve`."""
        for k in i.tolist():
            self.reasons[k] = reason

    def store(self, i: Array, t: float, runs: CoreRuns, values: Array) -> None:
        """Record runs that finished."""
        done = runs.finished
        self.t[i], self.y[i], self.counts[i], self.drift[i] = t, runs.y[done], runs.counts[done], runs.drift[done]
        self.signals[i] = values
        for k in i.tolist():
            self.status[k], self.message[k] = "finished", STATUS["finished"]

    def in_python(self) -> dict[str, int]:
        """Return the numbers of runs that `mbdae.solve` computed, by reason."""
        pairs = zip(self.reasons, self.status, strict=True)
        return dict(Counter(reason for reason, status in pairs if reason and status != UNFINISHED))
