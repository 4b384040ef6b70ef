"""Atomic writing of files, reading of UTF-8 text, the suffixes of results, and LaTeX for figures."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError

VIDEO_SUFFIXES = (".mp4", ".gif")
PICTURE_SUFFIXES = (".png", ".svg", ".pdf", ".pgf")
TABLE_SUFFIXES = (".csv", ".json", ".tex")  # formats of saved results of studies


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path next to ``path``; rename it to ``path`` if the block ends without an error.

    Raises:
        InputError: if the folder does not exist or is not writable.
    """
    import tempfile  # slow to import

    path = Path(path)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}", suffix=path.suffix)
        os.close(handle)
    except OSError as e:
        raise InputError(f"cannot write {path}: {e.strerror or e}") from None
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    except OSError as e:
        raise InputError(f"cannot write {path}: {e.strerror or e}") from None
    finally:
        temporary.unlink(missing_ok=True)


def find_latex() -> str:
    """Return the name of an installed LaTeX engine, which is required to save figures as .pgf.

    Raises:
        InputError: if there is none.
    """
    from shutil import which  # slow to import

    engines = "xelatex", "lualatex", "pdflatex"
    if not (engine := next(filter(which, engines), None)):
        missing = f"none of {', '.join(engines)} is installed: install one, or save as .pdf or .svg"
        raise InputError(f"a .pgf figure needs LaTeX to typeset its labels, and {missing}")
    return engine


def write_page(path: str | Path, page: Callable[[], str], what: str) -> None:
    """Write the result of ``page`` as .html, atomically.

    Raises:
        InputError: for another suffix, or if the folder does not exist or is not writable.
    """
    if Path(path).suffix != ".html":
        raise InputError(f"{what} is saved as .html, got {str(path)!r}")
    with atomic_write(path) as temporary:
        temporary.write_text(page(), "utf-8")


def read_text(path: Path) -> str:
    """Read a text file, without the byte order mark that editors of Windows begin it with.

    Raises:
        InputError: if it cannot be read as UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"cannot read {path}: {e}") from None
