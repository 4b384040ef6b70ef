"""A problem bound to a workspace: which back end computes is chosen here."""

from collections.abc import Iterable
from typing import Any

from ..backend import choose, known, status
from ..errors import InputError
from ..mechanism import Mechanism, NotCompiled
from ..system import System


def bind(problem: Any, formulation: str, baumgarte: tuple[float, float] | None, backend: str) -> tuple[System, str]:
    """Bind a problem to a workspace, of the compiled core where that can be.

    Returns:
        The workspace; and, for ``backend="auto"``, what keeps the run from the core, in words, or "".

    Raises:
        InputError: for ``backend="native"`` where the core is missing or does not have what is asked for.
        UnknownNameError: for a back end or a formulation that does not exist.
    """
    missing = "" if isinstance(problem, Mechanism) else "textbook problems"
    native = None if missing and backend in ("auto", "native") else choose(backend)
    if native:
        try:
            return problem.system(formulation, baumgarte, native), ""
        except NotCompiled as e:
            missing = str(e)
    if missing and backend == "native":
        raise InputError(f"backend='native' does not have {missing}: take 'auto' or 'python'")
    why = "" if backend == "python" else missing or status()
    return problem.system(formulation, baumgarte), why


def common(problem: Any, runs: Iterable[tuple[str, tuple[float, float] | None]], backend: str) -> tuple[str, str]:
    """Choose one back end for several runs, so that their times compare.

    Args:
        problem: a mechanism or a textbook problem.
        runs: formulation, and alpha and beta of Baumgarte's terms.
        backend: as of `mbdae.solve`.

    Returns:
        ``"native"`` or ``"python"``; and what keeps one of the runs from the core, in words, or "".

    Raises:
        InputError: for ``backend="native"`` where the core does not have all of them.
        UnknownNameError: for a back end that does not exist.
    """
    reasons = {bind(problem, *run, known(backend))[1] for run in runs}
    because = "; ".join(sorted(reasons - {""}))
    return "python" if backend == "python" or because else "native", because
