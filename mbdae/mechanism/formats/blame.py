"""What is wrong with a mechanism file, said with the file and the place in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ...errors import MbdaeError, UnknownNameError
from .schema import MechanismFile


@contextmanager
def blamed(path: str, file: MechanismFile) -> Iterator[None]:
    """Put the path of a file before what is raised, and the entry where an unknown name stands; nothing without it."""
    try:
        yield
    except MbdaeError as e:
        if not path:
            raise
        place = next(_places(file.model_dump(), e.name), "") if isinstance(e, UnknownNameError) else ""
        e.args = (": ".join(filter(None, (path, place, str(e)))),)
        raise


def _places(data: Any, name: str, path: str = "") -> Iterator[str]:
    """Paths of the keys and values that are a name, but for those that entries have themselves."""
    known = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list | tuple) else ()
    for key, value in known:
        label = value.get("name") or key if isinstance(value, dict) else key
        here = f"{path}.{label}" if path else str(label)
        if key != "name" and name in (key, value if isinstance(value, str) else None):
            yield here
        yield from _places(value, name, here)
