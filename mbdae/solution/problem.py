"""Arguments that are problems: a mechanism, a textbook problem, its name or path, or its tables."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError, UnknownNameError, require
from ..mechanism import Mechanism, load
from ..textbook.problems import TEXTBOOK
from .solution import Problem


def mechanism_of(problem: Any, what: str) -> Mechanism:
    """Return a mechanism; load it if it is given by name, path or tables.

    Args:
        problem: a mechanism, or an argument of `mbdae.load`.
        what: the calling function, for messages.

    Raises:
        UnknownNameError, InputError: as for `mbdae.load`, and for any other value.
    """
    if isinstance(problem, str | Path | Mapping):
        return load(problem)
    require(problem, Mechanism, f"{what} takes a Mechanism, tables, or a name or path (see mbdae.load)")
    return problem  # type: ignore[no-any-return]


def problem_of(problem: object, what: str) -> Problem:
    """Return a mechanism or a textbook problem; load it if it is given by name, path or tables.

    Raises:
        UnknownNameError, InputError: as for `mechanism_of`.
    """
    if isinstance(problem, str) and problem in TEXTBOOK:
        return TEXTBOOK[problem]()
    if isinstance(problem, str | Path | Mapping):
        try:
            return load(problem)
        except UnknownNameError as e:
            if e.kind != "model":
                raise
            raise UnknownNameError("model", e.name, [*e.valid[:-1], *TEXTBOOK, e.valid[-1]]) from None
    if not isinstance(problem, Problem):
        expected = "a Mechanism or a Hessenberg problem, tables, or a name or path (see mbdae.load)"
        raise InputError(f"{what} takes {expected}, got {problem!r:.60}")
    return problem  # type: ignore[no-any-return]
