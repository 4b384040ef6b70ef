"""Sub-command ``report``."""

from typing import Any

from ...cli.model import ChosenModel
from ...cli.output import PAGES, emit, exit_interrupted, output_file
from ...cli.runs import span
from ...cli.study_command import Output, Study, command
from ...progress import progress_bar

PAGE = output_file("-o", "--output", required=True, suffixes=PAGES, help="The HTML page to write.")


@command("repeats workers", PAGE, shared="methods t_span rtol units")
def report(study: Study, out: Output, model: ChosenModel, t_span: tuple[float, ...] | None, **options: Any) -> None:
    """Write one page on a model. Card, run with replay, drift, orders and comparison, with all data to reproduce it.

    Ctrl-C writes the finished parts.
    """
    mech, path = model.load(), out.written[0]
    with progress_bar("report", 1.0) as report_progress:
        result = study(mech, span(mech, t_span), progress=report_progress, **options)
    try:
        result.save(path)
    except KeyboardInterrupt:
        emit({**result.to_dict(), "written": []}, str(result), out.as_json)
        exit_interrupted(f"before {path} was written")
    out.emit(result.to_dict(), f"{result}\n")
    if result.missing:
        exit_interrupted(result.without)
