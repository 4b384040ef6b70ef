"""What tells functions apart, across runs of Python: their code and all that they hold."""

import pickle
from dataclasses import fields, is_dataclass
from functools import partial
from types import CodeType, FunctionType, MethodType
from typing import Any

import numpy as np


def fingerprint(x: Any, seen: tuple[int, ...] = ()) -> Any:
    """Return plain data for JSON that differs where functions do: in code, defaults, closures, partial arguments.

    Objects are told apart by what pickle keeps of them, and by their kind alone where it refuses.
    """
    if x is None or isinstance(x, bool | int | float | str):
        return x
    if id(x) in seen:
        return "itself"
    seen = (*seen, id(x))

    def inner(y: Any) -> Any:
        return fingerprint(y, seen)

    if isinstance(x, np.ndarray | np.generic):
        return [str(x.dtype), x.tolist()]
    if isinstance(x, list | tuple | set | frozenset):
        return [inner(y) for y in (sorted(x, key=repr) if isinstance(x, set | frozenset) else x)]
    if isinstance(x, dict):
        return [[inner(k), inner(y)] for k, y in x.items()]
    if isinstance(x, partial):
        return ["partial", inner(x.func), inner(x.args), inner(x.keywords)]
    if isinstance(x, MethodType):
        return [inner(x.__func__), inner(x.__self__)]
    if isinstance(x, CodeType):
        return [x.co_code.hex(), list(x.co_names), [inner(c) for c in x.co_consts]]
    if isinstance(x, FunctionType):
        held = [_content(cell) for cell in x.__closure__ or ()]
        return [x.__name__, *(inner(y) for y in (x.__code__, held, x.__defaults__, x.__kwdefaults__))]
    if is_dataclass(x) and not isinstance(x, type):
        return [type(x).__qualname__, [inner(getattr(x, f.name)) for f in fields(x)]]
    try:
        return pickle.dumps(x, protocol=4).hex()
    except Exception:
        return f"{type(x).__module__}.{type(x).__qualname__}"


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # empty
        return None
