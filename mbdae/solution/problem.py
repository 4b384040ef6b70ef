"""Problem arguments: a mechanism, a textbook problem, the name or path of one, or its tables."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError, UnknownNameError, require
from ..mechanism import Mechanism, load
from ..textbook.problems import TEXTBOOK
from .solution import Problem


def mechanism_of(given: Any, what: str) -> Mechanism:
    """Return a mechanism, loaded unless it is one.

    Args:
        given: a mechanism, or an argument of `mbdae.load`.
        what: the calling function, for messages.

    Raises:
        UnknownNameError, InputError: as for `mbdae.load`, and for any other value.
    """
    if isinstance(given, str | Path | Mapping):
        return load(given)
    require(given, Mechanism, f"{what} takes a Mechanism, tables, or a name or path (see mbdae.load)")
    return given  # type: ignore[no-any-return]


def problem_of(given: object, what: str) -> Problem:
    """Return a mechanism or a textbook problem, loaded unless it is one.

    Raises:
        UnknownNameError, InputError: as for `mechanism_of`.
    """
    if isinstance(given, str) and given in TEXTBOOK:
        return TEXTBOOK[given]()
    if isinstance(given, str | Path | Mapping):
        try:
            return load(given)
        except UnknownNameError as e:
            if e.kind != "model":
                raise
            raise UnknownNameError("model", e.name, [*e.valid[:-1], *TEXTBOOK, e.valid[-1]]) from None
    if not isinstance(given, Problem):
        known = "a Mechanism or a Hessenberg problem, tables, or a name or path (see mbdae.load)"
        raise InputError(f"{what} takes {known}, got {given!r:.60}")
    return given  # type: ignore[no-any-return]
