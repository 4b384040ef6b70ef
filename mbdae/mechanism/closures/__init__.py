"""Closures, drivers, stops and clutches, from the user's description to rows; `kinds` has a file for each closure."""

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from ...discovery import members, plugins
from .closure import Closure, kinds_of

tuple(members(f"{__name__}.kinds", type))  # which makes them known


def _new(value: Any) -> bool:
    of_closures = isinstance(value, type) and issubclass(value, Closure)
    return of_closures and kinds_of(Closure).get(value.model_fields["kind"].default) is value


plugins("mbdae.closures", _new, "a class of closures with a kind of its own")
_FOUND: dict[str, type[Closure]] = kinds_of(Closure)
KINDS = {kind: c for kind, c in _FOUND.items() if not any(f.exclude for f in c.model_fields.values())}
"""Every kind of closure that a file can describe: without Python functions."""


def what_is_kept(kind: type[Closure]) -> tuple[str, str]:
    """Return the number of rows of a kind, and what they keep, both from the first line of its documentation."""
    rows, _, what = (kind.__doc__ or "").partition("\n")[0].rstrip(".").partition(": ")
    return rows.partition(" ")[0], what


Closure.__doc__ = f"{Closure.__doc__}\n" + "\n".join(
    f"    {kind:<12} {' '.join(what_is_kept(c))}" for kind, c in KINDS.items()
)

if TYPE_CHECKING:
    AnyClosure = Closure
else:
    AnyClosure = Annotated[Union[tuple(_FOUND.values())], Field(discriminator="kind")]  # noqa: UP007
