"""Markdown tables of the kinds of closures and forces, and of all keys of mechanism files, from their classes.

They are inserted between comments of `models/README.md`. `models/models.json` has the output of `mbdae models`, and
`mbdae/__init__.py` the public names for editors. Rewrite all by

    python tests/key_tables.py
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

import mbdae
from mbdae.discovery import LIBRARY_FILES, MODEL_LIST
from mbdae.mechanism.checked_table import Table, tables_in
from mbdae.mechanism.closures import kinds_in_files, rows_and_summary
from mbdae.mechanism.closures.closure import Closure
from mbdae.mechanism.forces import FORCES
from mbdae.mechanism.formats.mechanism_file.schema import MechanismFile
from mbdae.mechanism.formats.model_library import ROBOTS
from mbdae.mechanism.time_functions.time_functions import TIME_FUNCTIONS

KINDS = kinds_in_files()
PAGE = Path(__file__).parent.parent / "models" / "README.md"
MODELS_FILE = PAGE.parent / MODEL_LIST
BETWEEN_MARKS = r"(?<=<!-- {0}: written by tests/key_tables.py -->\n).*(?=<!-- end of {0} -->)"
VALUE_TYPES = {float: "number", int: "whole number", str: "text", bool: "true or false"}
LIMITS = {"ge": ">= {}", "gt": "> {}", "min_length": "{} or more"}
PLURALS = {"number": "numbers", "text": "texts", "2 numbers": "pairs of numbers", "table": "tables"}


def closures() -> str:
    """Return a row for each kind of closure: its rows, its keys, and its constraint."""
    out = "\n| closure | rows | required | optional | constraint |\n|---|---|---|---|---|\n"
    for kind, table in KINDS.items():
        rows, what = rows_and_summary((table.__doc__ or "").partition("\n")[0])
        keys = {k: f.is_required() for k, f in table.model_fields.items() if k not in Closure.model_fields}
        needed, possible = (", ".join(f"`{k}`" for k in keys if keys[k] is x) for x in (True, False))
        out += f"| `{kind}` | {rows} | {needed} |{possible and f' {possible}'} | {what} |\n"
    return out + "\n"


def forces() -> str:
    """Return a row for each kind of force: the first sentence of its class."""
    out = "\n| force | description |\n|---|---|\n"
    for kind, table in sorted((c.model_fields["kind"].default, c) for c in FORCES):
        first = _summary(table).replace("|", r"\|")
        out += f"| `{kind}` | {first} |\n"
    return out + "\n"


def keys() -> str:
    """Return a table for each class: its formula or summary, then key, values, default, description."""
    found = {MechanismFile: ("**The file itself**", "".join(rows(MechanismFile)))}
    shared = {b: None for c in KINDS.values() for b in c.__mro__[::-1] if issubclass(b, Table)}
    bases = [b for b in shared if b not in KINDS.values()]
    found[Closure] = "**`[[closure]]`**", "".join(dict.fromkeys(row for b in bases for row in rows(b, own=True)))
    for heading, table in _inside(MechanismFile):
        if not any(f.exclude for f in table.model_fields.values()):  # Python functions are not possible in a file
            summarized = table in FORCES or table in KINDS.values()  # in the tables of closures and forces
            what = "" if summarized else ": " + _summary(table)
            found.setdefault(table, (f"**`{heading}`**{what}", "".join(rows(table, own=table in KINDS.values()))))
    return "\n" + "\n".join(
        f"{found[table][0]}\n\n| key | value | default | description |\n|---|---|---|---|\n{found[table][1]}"
        for table in sorted(found, key=TIME_FUNCTIONS.__contains__)
        if found[table][1]
    )


PARTS = {"closures": closures, "forces": forces, "keys": keys}


def page(text: str) -> str:
    """Return the page with new tables."""
    for name, part in PARTS.items():
        text = re.sub(BETWEEN_MARKS.format(name), lambda _, part=part: part(), text, flags=re.S)
    return text


def rows(table: type[Table], *, own: bool = False) -> Iterator[str]:
    """Yield the rows of a class, only its own keys if ``own``; its ``kind`` is in the heading."""
    descriptions = {k: v for c in reversed(table.__mro__) for k, v in _attributes(c.__doc__ or "").items()}
    for key, field in table.model_fields.items():
        if own and key not in vars(table).get("__annotations__", ()):
            continue
        if get_origin(field.annotation) is not Literal or len(get_args(field.annotation)) > 1:
            yield f"| `{key}` | {values_of(field)} | {default_of(field)} | {descriptions[key]} |\n"


def values_of(field: FieldInfo) -> str:
    """Return the values of a key, with its limits."""
    limits = (t.format(getattr(m, k)) for m in field.metadata for k, t in LIMITS.items() if hasattr(m, k))
    return ", ".join([_words(field.annotation), *limits])


def default_of(field: FieldInfo) -> str:
    """Return the default of a key."""
    value = field.get_default(call_default_factory=True)
    if field.is_required():
        return "needed"
    values = [getattr(v, "value", v) for v in (value if isinstance(value, tuple) else [value])]
    if all(v in (None, "", {}) or isinstance(v, Table) for v in values):
        return ""
    plain = [str(v).lower() if isinstance(v, bool) else v if isinstance(v, str) else f"{v:g}" for v in values]
    return f"`[{', '.join(plain)}]`" if isinstance(value, tuple) else f"`{plain[0]}`"


def _summary(table: type[Table]) -> str:
    first = (table.__doc__ or "").partition("\n")[0].replace("``", "`")
    return first if first.endswith("...") else first.removesuffix(".")


def _inside(table: type[Table]) -> Iterator[tuple[str, type[Table]]]:
    for key, field in table.model_fields.items():
        for inner in tables_in(field.annotation):
            kinds = get_args(inner.model_fields["kind"].annotation) if "kind" in inner.model_fields else ()
            where = f"[[{key}]]" if get_origin(field.annotation) is tuple else f"[{key}]"
            yield f'kind = "{kinds[0]}"' if len(kinds) == 1 else where, inner
            yield from _inside(inner)


def _words(annotation: Any) -> str:
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation in VALUE_TYPES:
        return VALUE_TYPES[annotation]
    if origin is Annotated and not tables_in(annotation):
        return _words(parts[0])
    if origin is Literal:
        return ", ".join(f"`{p}`" for p in parts)
    if origin is dict:
        return f"name = {_words(parts[1])}"
    if origin is tuple:
        word = _words(parts[0])
        several = PLURALS.get(word, word.replace("number or function", "numbers or functions"))
        return several if parts[-1] is Ellipsis else f"{len(parts)} {several}"
    if set(parts) == set(TIME_FUNCTIONS) or (origin is Annotated and set(tables_in(annotation)) == set(TIME_FUNCTIONS)):
        return "number or function of time"
    if origin in (Union, UnionType) and not set(parts) <= set(tables_in(annotation)):
        return ", or ".join(_words(p) for p in parts if p is not NoneType)
    return "table"


def editors(text: str) -> str:
    """Return `mbdae/__init__.py` with a line for each public name, for editors and type checkers."""
    places = sorted(mbdae._modules_of_names().items(), key=lambda place: place[1].split("."))
    lines = "".join(f"    from {module.removeprefix('mbdae')} import {name} as {name}\n" for name, module in places)
    return re.sub(r"(?<=for editors and type checkers\n)(    from .*\n)+", lines, text)


def models() -> str:
    """Return the models of mbdae: sizes, parameters with their valid values, and whether they need robots."""
    out = []
    for name in mbdae.model_names():
        m = mbdae.load(name)
        sizes = {"nq": m.nq, "nv": m.nv, "ng": m.ng, "dof": mbdae.info(m).dof}
        parameters = {p["name"]: p["takes"] for p in m.source["parameters"]}
        files = [path for file in LIBRARY_FILES if (path := PAGE.parent / name / file).is_file()]
        robots = any(ROBOTS in path.read_text() for path in files)
        out.append({"name": name, "title": m.title, "sizes": sizes, "parameters": parameters, "robots": robots})
    return "[\n" + ",\n".join(map(json.dumps, out)) + "\n]\n"


def _attributes(doc: str) -> dict[str, str]:
    section = re.search(r"\n( *)Attributes:\n(.*?)(?=\n\s*\n|\Z)", doc, re.S)
    if not section:
        return {}
    entry = rf"^{section[1]}    (\w+): (.*?)(?=^{section[1]}    \w+: |\Z)"
    found = re.findall(entry, section[2] + "\n", re.S | re.M)
    descriptions = {key: " ".join(text.split()).replace("``", "`") for key, text in found}
    return {key: text if text.endswith("...") else text.removesuffix(".") for key, text in descriptions.items()}


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
    MODELS_FILE.write_text(models())
    SOURCE = Path(mbdae.__file__)
    SOURCE.write_text(editors(SOURCE.read_text()))
