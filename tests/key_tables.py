"""The keys of every table of a mechanism file in Markdown, made from the classes that check them.

`models/README.md` holds them between two comments. After a change of a key, rewrite them:

    python tests/key_tables.py
"""

import re
from collections.abc import Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from mbdae.mechanism.checked_table import Table
from mbdae.mechanism.formats.schema import MechanismFile
from mbdae.mechanism.time_functions import SIGNALS

PAGE = Path(__file__).parent.parent / "models" / "README.md"
BETWEEN = re.compile(r"(?<=<!-- keys: written by tests/key_tables.py -->\n).*(?=<!-- end of keys -->)", re.S)
PLAIN = {float: "number", int: "whole number", str: "text", bool: "true or false"}
LIMITS = {"ge": ">= {}", "gt": "> {}", "min_length": "{} or more"}
SEVERAL = {"number": "numbers", "text": "texts", "2 numbers": "pairs of numbers", "table": "tables"}


def markdown() -> str:
    """One small table for each class: key, values, default, description."""
    found = {MechanismFile: "The file itself"}
    for heading, table in _inside(MechanismFile):
        found.setdefault(table, f"`{heading}`")
    return "\n" + "\n".join(
        f"**{found[table]}**\n\n| key | takes | left out | what it is |\n|---|---|---|---|\n{''.join(rows(table))}"
        for table in sorted(found, key=SIGNALS.__contains__)
        if not any(f.exclude for f in table.model_fields.values())  # Python functions are not possible in a file
    )


def rows(table: type[Table]) -> Iterator[str]:
    """The rows of one class; the ``kind`` that selects the class is in its heading."""
    said = {k: v for c in reversed(table.__mro__) for k, v in _attributes(c.__doc__ or "").items()}
    for key, field in table.model_fields.items():
        if get_origin(field.annotation) is not Literal or len(get_args(field.annotation)) > 1:
            yield f"| `{key}` | {takes(field)} | {left_out(field)} | {said[key]} |\n"


def takes(field: FieldInfo) -> str:
    """The values of a key, with its limits."""
    limits = (t.format(getattr(m, k)) for m in field.metadata for k, t in LIMITS.items() if hasattr(m, k))
    return ", ".join([_words(field.annotation), *limits])


def left_out(field: FieldInfo) -> str:
    """The default of a key."""
    value = field.get_default(call_default_factory=True)
    if field.is_required():
        return "needed"
    values = [getattr(v, "value", v) for v in (value if isinstance(value, tuple) else [value])]
    if all(v in (None, "", {}) or isinstance(v, Table) for v in values):
        return ""
    plain = [str(v).lower() if isinstance(v, bool) else v if isinstance(v, str) else f"{v:g}" for v in values]
    return f"`[{', '.join(plain)}]`" if isinstance(value, tuple) else f"`{plain[0]}`"


def _inside(table: type[Table]) -> Iterator[tuple[str, type[Table]]]:
    for key, field in table.model_fields.items():
        for inner in _tables(field.annotation):
            kinds = get_args(inner.model_fields["kind"].annotation) if "kind" in inner.model_fields else ()
            where = f"[[{key}]]" if get_origin(field.annotation) is tuple else f"[{key}]"
            yield f'kind = "{kinds[0]}"' if len(kinds) == 1 else where, inner
            yield from _inside(inner)


def _tables(annotation: Any) -> list[type[Table]]:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return [annotation]
    return [t for part in get_args(annotation) for t in _tables(part)]


def _words(annotation: Any) -> str:
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation in PLAIN:
        return PLAIN[annotation]
    if origin is Literal:
        return ", ".join(f"`{p}`" for p in parts)
    if origin is dict:
        return f"name = {_words(parts[1])}"
    if origin is tuple:
        word = _words(parts[0])
        several = SEVERAL.get(word, word.replace("number or function", "numbers or functions"))
        return several if parts[-1] is Ellipsis else f"{len(parts)} {several}"
    if set(parts) == set(SIGNALS) or (origin is Annotated and set(_tables(annotation)) == set(SIGNALS)):
        return "number or function of time"
    if origin in (Union, UnionType) and not set(parts) <= set(_tables(annotation)):
        return ", or ".join(_words(p) for p in parts if p is not NoneType)
    return "table"


def _attributes(doc: str) -> dict[str, str]:
    section = re.search(r"\n( *)Attributes:\n(.*?)(?=\n\s*\n|\Z)", doc, re.S)
    if not section:
        return {}
    entry = rf"^{section[1]}    (\w+): (.*?)(?=^{section[1]}    \w+: |\Z)"
    found = re.findall(entry, section[2] + "\n", re.S | re.M)
    return {key: " ".join(text.split()).replace("``", "`").rstrip(".") for key, text in found}


if __name__ == "__main__":
    PAGE.write_text(BETWEEN.sub(lambda _: markdown(), PAGE.read_text()))
