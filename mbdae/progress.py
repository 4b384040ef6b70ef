"""Progress bars of long computations, on a terminal and in a notebook."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from time import monotonic
from typing import Any

UPDATE_INTERVAL = 0.1  # s, for a bar in a notebook
REPORT_AFTER, MIN_REMAINING = 10.0, 60.0  # s: without a bar, one line is printed if a computation takes longer

Report = Callable[..., None]


@contextmanager
def progress_bar(label: str, total: float | None = 1.0) -> Iterator[Report]:
    """Show a progress bar while the block runs: on stderr if it is a terminal, or in the output of a notebook.

    Without a terminal or notebook, one line is printed on stderr if the block will take long.

    The block receives the ``progress`` argument of `mbdae.solve` and of the studies: a function of a fraction, a text,
    or both.

    Args:
        label: initial text next to the bar.
        total: 1, or None for studies that report no fractions (`mbdae.order`, `mbdae.fit`).

    Example:
        >>> with mbdae.progress_bar("links") as progress:                            # doctest: +SKIP
        ...     runs = mbdae.sweep("slider_crank", links, 2.0, progress=progress)
    """
    terminal = sys.stderr.isatty()
    if not terminal and "IPython" not in sys.modules:
        yield _one_line(label)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True, force_terminal=terminal)
    if console.is_jupyter:
        with _in_notebook(label) as report:
            yield report
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(label, total=total)

        def report(value: Any, name: str | None = None) -> None:
            text, fraction = _text_and_fraction(value, name)
            bar.update(task, description=text, completed=fraction)

        yield report


def _one_line(label: str) -> Report:
    """Return a report function that prints the remaining time once on stderr if it is long."""
    start, reported = monotonic(), False

    def report(value: Any, name: str | None = None) -> None:
        nonlocal reported
        fraction, elapsed = _text_and_fraction(value, name)[1], monotonic() - start
        if reported or not fraction or elapsed < REPORT_AFTER:
            return
        remaining = elapsed * (1 / fraction - 1)
        if remaining < MIN_REMAINING:
            return
        reported = True
        sys.stderr.write(f"{label}: {100 * fraction:.2g} % after {elapsed:.0f} s, about {remaining:.2g} s are left\n")

    return report


@contextmanager
def _in_notebook(label: str) -> Iterator[Report]:
    """Show a bar in HTML that is updated in place; the bar of rich would require ipywidgets."""
    from IPython.display import HTML, display

    handle = display(HTML(_bar(label, None)), display_id=True)
    text, updated = label, monotonic()

    def report(value: Any, name: str | None = None) -> None:
        nonlocal text, updated
        new_text, fraction = _text_and_fraction(value, name)
        text = text if new_text is None else new_text
        if monotonic() - updated >= UPDATE_INTERVAL:
            updated = monotonic()
            handle.update(HTML(_bar(text, fraction)))

    try:
        yield report
    finally:
        handle.update(HTML(""))


def _text_and_fraction(value: float | str | None, name: str | None) -> tuple[str | None, float | None]:
    """Return the text and the fraction of a report; None if not given."""
    return (value, None) if isinstance(value, str) else (name, value)


def _bar(text: str, fraction: float | None) -> str:
    value = "" if fraction is None else f' value="{fraction:.4f}"'
    return f"<progress{value}></progress> {escape(text)}"
