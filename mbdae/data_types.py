"""Types of data for use outside of Python: JSON documents, and input of the compiled core."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

Json: TypeAlias = bool | int | float | str | Sequence[Any] | Mapping[str, Any] | None
JsonObject: TypeAlias = dict[str, Json]

CoreData: TypeAlias = dict[str, Any]
"""Fields of a C++ struct by name: numbers, lists, arrays, Python functions. The core checks names and types."""

Columns: TypeAlias = Mapping[str, Sequence[Any]]
"""Values of parameters by name, one for each of many runs."""
