"""Mechanism files with parameters: Python files whose function ``mechanism`` returns the tables of a mechanism file.

    def mechanism(N: Annotated[int, Field(ge=1)] = 2) -> dict:
        return {"title": f"{N} four-bars", "body": [...], "closure": [...]}

The annotations define the valid values of the parameters; omitted parameters have their defaults.
"""

import inspect
import runpy
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from pydantic import ConfigDict, ValidationError, create_model
from pydantic.fields import FieldInfo

from ....errors import InputError, MbdaeError, UnknownNameError
from .schema import MechanismFile, checked

FUNCTION = "mechanism"
KEYWORDS = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
LIMITS = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}


def split(name: str) -> tuple[str, dict[str, str]]:
    """Split ``name?N=10&legs=3`` into the name and its parameters, as text.

    Raises:
        InputError: for parameters without a value.
    """
    head, mark, tail = name.partition("?")
    if not mark or _exists(name):
        return name, {}
    pairs = [pair.partition("=") for pair in tail.split("&")]
    if not all(key and equals for key, equals, _ in pairs):
        raise InputError(f"{name!r}: parameters are written {head}?name=value&name=value")
    return head, {key: value for key, _, value in pairs}


def _exists(name: str) -> bool:
    try:
        return Path(name).exists()
    except (OSError, ValueError):  # not a path: too long, for instance
        return False


class ParametricFile:
    """A mechanism.py, run once: the function for its tables, and the valid values of its parameters.

    Args:
        path: path of the file.

    Attributes:
        parameters: description (type, range and default) of each parameter.

    Raises:
        InputError: for a file that cannot be run, or an invalid function.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.function = path, _function(path)
        fields = _fields(self.function, path)
        self.parameters = {key: _describe(field) for key, field in fields.items()}
        finite = ConfigDict(allow_inf_nan=False)
        self._table: Any = create_model("Parameters", __config__=finite, **_definitions(fields))

    def tables(self, name: str, values: Mapping[str, object]) -> tuple[MechanismFile, list[dict[str, Any]]]:
        """Call the function.

        Returns:
            The mechanism file; and name, value and description of each parameter.

        Raises:
            UnknownNameError: for an unknown parameter; lists the valid parameters, with their defaults.
            InputError: for an invalid value, or a function that fails.
        """
        chosen = self._all_values(name, values)
        call = ", ".join(f"{key}={value!r}" for key, value in chosen.items())
        try:
            content = self.function(**chosen)
        except MbdaeError:
            raise
        except Exception as e:
            raise InputError(f"{self.path}: {FUNCTION}({call}) failed: {type(e).__name__}: {e}") from e
        if not isinstance(content, dict):
            raise InputError(f"{self.path}: {FUNCTION}() returned {type(content).__name__}, expected a dict of tables")
        parameters = [{"name": key, "value": value, "takes": self.parameters[key]} for key, value in chosen.items()]
        return checked(content, f"{self.path}({call})"), parameters

    def _all_values(self, name: str, values: Mapping[str, object]) -> dict[str, Any]:
        """Return the values of all parameters."""
        known = [f"{key} ({words})" for key, words in self.parameters.items()]
        for key in values:
            if key not in self.parameters:
                raise UnknownNameError(f"parameter of {name}", key, known)
        try:
            return dict(self._table(**values).model_dump(mode="json"))
        except ValidationError as e:
            first = e.errors()[0]
            key = str(first["loc"][0])
            text = f"{name}: {key} = {first['input']}: {first['msg']}" if key in values else f"{name} needs {key}"
            raise InputError(f"{text}; parameters: {', '.join(known)}") from None


def _function(path: Path) -> Any:
    try:
        function = runpy.run_path(str(path)).get(FUNCTION)
    except (Exception, SystemExit) as e:
        raise InputError(f"{path} cannot be run: {type(e).__name__}: {e}") from e
    if not callable(function):
        raise InputError(f"{path} has no function {FUNCTION}(...) that returns the tables of a mechanism file")
    return function


def _fields(function: Any, path: Path) -> dict[str, FieldInfo]:
    """Return annotation, limits and default of each parameter."""
    parameters = inspect.signature(function).parameters
    if any(p.kind not in KEYWORDS for p in parameters.values()):
        raise InputError(f"{path}: {FUNCTION}() takes parameters by name only, no *args and no **kwargs")
    hints = get_type_hints(function, include_extras=True)
    missing = [key for key in parameters if key not in hints]
    if missing:
        raise InputError(f"{path}: parameter {missing[0]!r} of {FUNCTION}() needs an annotation, for instance: int")
    return {
        key: FieldInfo.from_annotation(hints[key])
        if p.default is p.empty
        else FieldInfo.from_annotated_attribute(hints[key], p.default)
        for key, p in parameters.items()
    }


def _definitions(fields: Mapping[str, FieldInfo]) -> dict[str, Any]:
    return {key: (field.annotation, field) for key, field in fields.items()}


def _describe(field: FieldInfo) -> str:
    kind = getattr(field.annotation, "__name__", str(field.annotation))
    if get_origin(field.annotation) is Literal:
        kind = " or ".join(repr(choice) for choice in get_args(field.annotation))
    limits = [f"{word} {getattr(m, key)}" for m in field.metadata for key, word in LIMITS.items() if hasattr(m, key)]
    default = "no default" if field.is_required() else f"default {field.default!r}"
    return ", ".join([" ".join([kind, " and ".join(limits)]).strip(), default])
