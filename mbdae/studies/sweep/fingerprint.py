"""Fingerprints of functions, equal across Python processes: of their code and all objects they refer to."""

import pickle
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass
from functools import partial
from types import CodeType, FunctionType, MethodType
from typing import Any

import numpy as np

Inner = Callable[[Any], Any]  # fingerprint of the contents of an object


def fingerprint(x: object, seen: tuple[int, ...] = ()) -> Any:
    """Return JSON data that identify a function by its code, defaults, closure variables and partial arguments.

    Objects are distinguished by their pickles, or by their type if they cannot be pickled.
    """
    if x is None or isinstance(x, bool | int | float | str):
        return x
    if id(x) in seen:
        return "itself"
    inner = partial(fingerprint, seen=(*seen, id(x)))
    for kinds, content in CONTENTS:
        if isinstance(x, kinds):
            return content(x, inner)
    if is_dataclass(x) and not isinstance(x, type):
        return [type(x).__qualname__, [inner(getattr(x, f.name)) for f in fields(x)]]
    try:
        return pickle.dumps(x, protocol=4).hex()
    except Exception:
        return f"{type(x).__module__}.{type(x).__qualname__}"


def _array(x: Any, inner: Inner) -> Any:
    return [str(x.dtype), x.tolist()]


def _members(x: Iterable[object], inner: Inner) -> Any:
    return [inner(y) for y in x]


def _set(x: Iterable[object], inner: Inner) -> Any:
    return [inner(y) for y in sorted(x, key=repr)]


def _mapping(x: dict[Any, Any], inner: Inner) -> Any:
    return [[inner(k), inner(y)] for k, y in x.items()]


def _partial(x: "partial[Any]", inner: Inner) -> Any:
    return ["partial", inner(x.func), inner(x.args), inner(x.keywords)]


def _method(x: MethodType, inner: Inner) -> Any:
    return [inner(x.__func__), inner(x.__self__)]


def _code(x: CodeType, inner: Inner) -> Any:
    return [x.co_code.hex(), list(x.co_names), [inner(c) for c in x.co_consts]]


def _function(x: FunctionType, inner: Inner) -> Any:
    enclosed = [_content(cell) for cell in x.__closure__ or ()]
    return [x.__name__, *(inner(y) for y in (x.__code__, enclosed, x.__defaults__, x.__kwdefaults__))]


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # empty
        return None


CONTENTS: tuple[tuple[Any, Callable[[Any, Inner], Any]], ...] = (
    ((np.ndarray, np.generic), _array),
    ((list, tuple), _members),
    ((set, frozenset), _set),
    (dict, _mapping),
    (partial, _partial),
    (MethodType, _method),
    (CodeType, _code),
    (FunctionType, _function),
)
