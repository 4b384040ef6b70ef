"""Checked tables: what may stand in a mechanism file, or be written in Python, with errors of one line."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, ValidationError

from ..errors import InputError

HUGE = 1e50  # numbers of SI units beyond this are mistakes, and their products overflow
KnownKeys = Callable[[Sequence[Any]], list[str]]


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


class _OneLine(ModelMetaclass):
    """Turns pydantic's report about a table written in Python into one line."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        known = sorted(getattr(cls, "model_fields", ()))
        if args:
            got = ", ".join(f"{value!r:.40}" for value in args)
            raise InputError(f"{cls.__name__} takes its values by name, {', '.join(known)}, got {got} without")
        try:
            return super().__call__(**kwargs)
        except ValidationError as e:
            raise InputError(f"{cls.__name__}: {one_line(e, lambda path: known)}") from None


class Table(BaseModel, metaclass=_OneLine):
    """A table whose unknown keys are errors and whose numbers are finite.

    Raises:
        InputError: for values that do not fit.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def one_line(error: ValidationError, known: KnownKeys) -> str:
    """Say the first validation error in one line; an unknown key is answered with the known ones at its place."""
    first = error.errors()[0]
    where = ".".join(str(p) for p in first["loc"])
    if first["type"] == "extra_forbidden":
        return f"unknown key {where}; known: {', '.join(known(first['loc'][:-1]))}"
    if first["type"] == "missing":
        return f"missing key {where}"
    message = first["msg"].removeprefix("Value error, ")
    return f"{where}: {message}, got {str(first['input'])[:80]!r}" if where else message
