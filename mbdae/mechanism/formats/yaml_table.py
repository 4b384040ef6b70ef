"""YAML, read with bounds: tables of names, lists and numbers."""

import math
from typing import Any

import yaml

from ...errors import InputError

LARGEST = 100_000  # entries of a file


def yaml_table(text: str, name: str) -> Any:
    """Read YAML whose aliases expand to no more entries than a file would have.

    Raises:
        InputError: for a text that is none.
    """
    try:
        node = yaml.compose(text, yaml.SafeLoader)
        if (size := _written_out(node, {})) > LARGEST:
            raise InputError(f"{name}: its aliases expand to {size:.3g} entries, more than {LARGEST}")
        if twice := _said_twice(node):
            raise InputError(f"{name}: the key {twice!r} is there more than once")
        return yaml.safe_load(text)
    except InputError:
        raise
    except (yaml.YAMLError, ValueError, RecursionError) as e:
        raise InputError(f"{name} is not YAML: {' '.join(str(e).split())[:200]}") from None


def _written_out(node: yaml.Node | None, known: dict[int, float]) -> float:
    """Number of entries of a node where every alias is written out; infinite if an alias contains itself."""
    if not isinstance(node, yaml.CollectionNode):
        return 1
    if id(node) not in known:
        known[id(node)] = math.inf  # while it is open
        inner = (x for entry in node.value for x in (entry if isinstance(entry, tuple) else (entry,)))
        known[id(node)] = 1 + sum(_written_out(x, known) for x in inner)
    return known[id(node)]


def _said_twice(node: yaml.Node | None) -> str:
    """A key that a table has more than once, of which YAML takes the last; empty where there is none."""
    waiting = [node]
    while waiting:
        at = waiting.pop()
        if isinstance(at, yaml.MappingNode):
            keys = [str(key.value) for key, _ in at.value if isinstance(key, yaml.ScalarNode)]
            if twice := next((key for key in keys if keys.count(key) > 1), ""):
                return twice
            waiting += [value for _, value in at.value]
        elif isinstance(at, yaml.SequenceNode):
            waiting += at.value
    return ""
