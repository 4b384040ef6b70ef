"""Binding of a problem to a workspace, and choice of the back end."""

from collections.abc import Iterable
from typing import Any

from ...backend import checked_backend, select_core, status
from ...errors import InputError
from ...mechanism import Mechanism, NotCompiled
from ...system import System


def bind(problem: Any, formulation: str, baumgarte: tuple[float, float] | None, backend: str) -> tuple[System, str]:
    """Bind a problem to a workspace; to one of the compiled core, where possible.

    Returns:
        The workspace; and, for ``backend="auto"``, the reason why the run cannot use the core, or "".

    Raises:
        InputError: for ``backend="native"`` if the core is missing or does not support the problem.
        UnknownNameError: for an unknown back end or formulation.
    """
    unsupported = "" if isinstance(problem, Mechanism) else "textbook problems"
    system = problem.workspaces.acquire if isinstance(problem, Mechanism) else problem.system
    native = None if unsupported and backend in ("auto", "native") else select_core(backend)
    if native:
        try:
            return system(formulation, baumgarte, native), ""
        except NotCompiled as e:
            unsupported = str(e)
    if unsupported and backend == "native":
        raise InputError(f"backend='native' does not support {unsupported}: use 'auto' or 'python'")
    reason = "" if backend == "python" else unsupported or status()
    return system(formulation, baumgarte), reason


def common_backend(
    problem: Any, runs: Iterable[tuple[str, tuple[float, float] | None]], backend: str
) -> tuple[str, str]:
    """Choose one back end for several runs, so that their computing times are comparable.

    Args:
        problem: a mechanism or a textbook problem.
        runs: formulation, and Baumgarte's parameters alpha and beta, of each run.
        backend: as for `mbdae.solve`.

    Returns:
        ``"native"`` or ``"python"``; and the reason why one of the runs cannot use the core, or "".

    Raises:
        InputError: for ``backend="native"`` if the core does not support all of them.
        UnknownNameError: for an unknown back end.
    """
    reasons = set()
    for run in runs:
        system, reason = bind(problem, *run, checked_backend(backend))
        reasons.add(reason)
        if isinstance(problem, Mechanism):
            problem.workspaces.release(system)  # type: ignore[arg-type]
    because = "; ".join(sorted(reasons - {""}))
    return "python" if backend == "python" or because else "native", because
