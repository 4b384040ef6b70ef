"""Closures, drivers, stops and clutches: their descriptions and their rows; `kinds` has a file for each closure."""

from typing import TYPE_CHECKING, Annotated, Union

from ...discovery import members, plugins
from ..tagged_union import TaggedByKind
from .closure import Closure, kinds_of

tuple(members(f"{__name__}.kinds", type))  # imports them


def _is_new_kind(value: object) -> bool:
    if not (isinstance(value, type) and issubclass(value, Closure)):
        return False
    return kinds_of(Closure).get(value.model_fields["kind"].default) is value


plugins("mbdae.closures", _is_new_kind, "a class of closures with a new kind")
_ALL: dict[str, type[Closure]] = kinds_of(Closure)
KINDS = {kind: c for kind, c in _ALL.items() if not any(f.exclude for f in c.model_fields.values())}
"""Every kind of closure that a file can describe: those without Python functions."""


def rows_and_summary(kind: type[Closure]) -> tuple[str, str]:
    """Return the number of rows of a kind, and what they enforce, both from the first line of its documentation."""
    rows, _, summary = (kind.__doc__ or "").partition("\n")[0].rstrip(".").partition(": ")
    return rows.partition(" ")[0], summary


Closure.__doc__ = f"{Closure.__doc__}\n" + "\n".join(
    f"    {kind:<12} {' '.join(rows_and_summary(c))}" for kind, c in KINDS.items()
)

if TYPE_CHECKING:
    AnyClosure = Closure
else:
    AnyClosure = Annotated[Union[tuple(_ALL.values())], TaggedByKind()]  # noqa: UP007
