"""Arguments of a public function, read from its source text: names, annotations, defaults and descriptions.

Importing a study takes a second; completion and ``--help`` only need its arguments.
"""

import ast
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from ..discovery import public_names

REQUIRED = object()  # default of required arguments


class Argument(NamedTuple):
    """An argument of a function.

    Attributes:
        kinds: the alternatives of its annotation, without None: ``("str", "Sequence[str]")``.
        default: its value when left out; `REQUIRED` for a required argument.
        help: the first sentence of its description in the docstring.
    """

    kinds: tuple[str, ...]
    default: Any
    help: str


@cache
def arguments_of(package: str, name: str) -> dict[str, Argument]:
    """Return the arguments of a function that a file of a package lists in ``__all__``, by name."""
    spec = find_spec(public_names(package)[name])
    text = Path(str(spec and spec.origin)).read_text("utf-8")
    match = re.search(rf'^def {name}\(.*?^    """.*?"""', text, re.M | re.S)
    function = ast.parse(match[0]).body[0] if match else None
    assert isinstance(function, ast.FunctionDef), f"{name} of {package} has no docstring"
    descriptions = dict(re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", ast.get_docstring(function) or "", re.M))
    arguments = [*function.args.args, *function.args.kwonlyargs]
    required = len(function.args.args) - len(function.args.defaults)
    defaults = [*[None] * required, *function.args.defaults, *function.args.kw_defaults]
    return {
        x.arg: Argument(_kinds(x.annotation, text), _value(default), _sentence(descriptions.get(x.arg, "")))
        for x, default in zip(arguments, defaults, strict=True)
    }


def _kinds(annotation: ast.expr | None, text: str) -> tuple[str, ...]:
    """Return the alternatives of an annotation; an alias in the file, ``Find = Literal[...]``, is resolved."""
    kinds: list[str] = []
    while isinstance(annotation, ast.BinOp):
        kinds.insert(0, ast.unparse(annotation.right))
        annotation = annotation.left
    first = ast.unparse(annotation) if annotation else "Any"
    choices = re.search(rf"^{re.escape(first)} = (Literal\[.*\])$", text, re.M)
    first = choices[1] if choices else first
    return tuple(kind for kind in (first, *kinds) if kind != "None")


def _value(default: ast.expr | None) -> Any:
    if default is None:
        return REQUIRED
    return ast.literal_eval(default) if not isinstance(default, ast.Name) else None


def _sentence(text: str) -> str:
    first = re.split(r"(?<=\.) ", " ".join(text.split()))[0].replace("`", "")
    return first if re.match(r"\w+[.=]\w", first) else f"{first[:1].upper()}{first[1:]}"  # q.joint stays
