"""Progress of long computations, as a bar on a terminal and in a notebook."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from time import monotonic
from typing import Any

OFTEN = 0.1  # s between two updates of a bar in a notebook

Tell = Callable[..., None]


@contextmanager
def progress_bar(label: str, total: float | None = 1.0) -> Iterator[Tell]:
    """Show a bar while the block runs: on stderr if that is a terminal, in the output of a notebook, else nowhere.

    The result is the ``progress`` argument of `mbdae.solve` and of the studies: called with a fraction, a text, or
    both.

    Args:
        label: the text beside the bar until another comes.
        total: 1, or None for studies that tell texts alone (`mbdae.order`, `mbdae.fit`).

    Example:
        >>> with mbdae.progress_bar("links") as progress:                            # doctest: +SKIP
        ...     runs = mbdae.sweep("slider_crank", links, 2.0, progress=progress)
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    if console.is_jupyter:
        with _in_notebook(label) as tell:
            yield tell
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(label, total=total)

        def tell(what: Any, name: str | None = None) -> None:
            text, done = _read(what, name)
            bar.update(task, description=text, completed=done)

        yield tell


@contextmanager
def _in_notebook(label: str) -> Iterator[Tell]:
    """A bar of HTML that is updated in place; that of rich would require ipywidgets."""
    from IPython.display import HTML, display

    place = display(HTML(_bar(label, None)), display_id=True)
    text, checked = label, monotonic()

    def tell(what: Any, name: str | None = None) -> None:
        nonlocal text, checked
        said, done = _read(what, name)
        text = text if said is None else said
        if monotonic() - checked >= OFTEN:
            checked = monotonic()
            place.update(HTML(_bar(text, done)))

    try:
        yield tell
    finally:
        place.update(HTML(""))


def _read(what: Any, name: str | None) -> tuple[str | None, float | None]:
    """Return text and fraction of a report: one of them, or both."""
    return (what, None) if isinstance(what, str) else (name, what)


def _bar(text: str, done: float | None) -> str:
    value = "" if done is None else f' value="{done:.4f}"'
    return f"<progress{value}></progress> {escape(text)}"
