"""Runs of commands: the time span of a model, and a run with a progress bar."""

from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..progress import progress_bar

if TYPE_CHECKING:
    from ..solution.solution import Problem, Solution


def span(mech: "Problem", t_span: tuple[float, ...] | None) -> tuple[float, float]:
    """Return the time span of an option: an end time, from 0, or start and end; by default the duration of the model.

    Raises:
        InputError: for a single end time that is not positive, or an empty span.
    """
    from ..integrate.options.span import checked_span

    start, *ends = t_span or (mech.duration,)
    return checked_span((start, *ends)) if ends else checked_span(start, end=True)


def simulate(
    mech: "Problem",
    *,
    method: str | None,
    t_span: tuple[float, ...] | None,
    rtol: float | None,
    step: float | None,
    **options: Any,
) -> "Solution":
    """Run a model from its start with a progress bar; for None, the setting of its file or the default is used.

    Raises:
        InputError: for tolerances together with a fixed step, and as for `mbdae.solve`.
    """
    from ..integrate.options.options import complete_settings
    from ..integrate.solve import solve

    if step is not None and (rtol is not None or options.get("atol") is not None):
        raise InputError("give --step for a fixed step size, or --rtol and --atol for step-size control, not both")
    settings = {"method": method, "rtol": rtol, "step": step, **options}
    with progress_bar(complete_settings(mech, settings)["method"].name, 1.0) as report:
        return solve(mech, span(mech, t_span), progress=report, **settings)
