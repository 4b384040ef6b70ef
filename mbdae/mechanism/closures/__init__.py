"""Closures, drivers, stops and clutches: descriptions and rows; `kinds` has one file per kind of closure."""

from typing import TYPE_CHECKING, Annotated, Any

from ...discovery import plugins
from ..tagged_union import TaggedByKind
from .closure import KINDS, Closure, kinds_of
from .kind_files import KIND_FILES


def _is_new_kind(value: object) -> bool:
    if not (isinstance(value, type) and issubclass(value, Closure)):
        return False
    kind = value.model_fields["kind"].default
    return kind not in KINDS and kinds_of(Closure).get(kind) is value


def rows_and_summary(first: str) -> tuple[str, str]:
    """Return the number of rows of a kind, and what they enforce, both from the first line of its documentation."""
    rows, _, summary = first.rstrip(".").partition(": ")
    return rows.partition(" ")[0], summary


_ADDED = plugins("mbdae.closures", _is_new_kind, "a class of closures with a new kind").values()
KINDS.update({c.model_fields["kind"].default: c for c in _ADDED})
_FIRST_LINES = {x.kind: x.first for x in KIND_FILES if x.first[0].isdigit()}
_FIRST_LINES |= {c.model_fields["kind"].default: (c.__doc__ or "").partition("\n")[0] for c in _ADDED}
Closure.__doc__ = f"{Closure.__doc__}\n" + "\n".join(
    f"    {kind:<12} {' '.join(rows_and_summary(first))}" for kind, first in sorted(_FIRST_LINES.items())
)


def kinds_in_files() -> dict[str, type[Closure]]:
    """Return every kind of closure that a file can describe: those without Python functions."""
    return {kind: c for kind, c in KINDS.items() if not any(f.exclude for f in c.model_fields.values())}


if TYPE_CHECKING:
    AnyClosure = Closure
else:
    AnyClosure = Annotated[Any, TaggedByKind(KINDS)]
