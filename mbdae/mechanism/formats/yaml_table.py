"""YAML with bounded size: mappings, lists and numbers."""

import math
from collections import Counter
from typing import Any

import yaml

from ...errors import InputError

MAX_ENTRIES = 100_000  # entries of a file


def yaml_table(text: str, name: str) -> Any:
    """Read a YAML text, with at most `MAX_ENTRIES` entries after its aliases are expanded.

    Raises:
        InputError: for a text that is not YAML, has too many entries, or duplicate keys.
    """
    try:
        loader = yaml.SafeLoader(text)
        node = loader.get_single_node()
        if (size := _expanded_size(node, {})) > MAX_ENTRIES:
            raise InputError(f"{name}: it has {size:.3g} entries with its aliases expanded, more than {MAX_ENTRIES}")
        if duplicate := _duplicate_key(node):
            raise InputError(f"{name}: the key {duplicate!r} occurs more than once")
        return None if node is None else loader.construct_document(node)
    except InputError:
        raise
    except (yaml.YAMLError, ValueError, RecursionError) as e:
        raise InputError(f"{name} is not YAML: {' '.join(str(e).split())[:200]}") from None


def _expanded_size(node: yaml.Node | None, sizes: dict[int, float]) -> float:
    """Return the number of entries of a node with all aliases expanded; infinite if an alias contains itself."""
    if not isinstance(node, yaml.CollectionNode):
        return 1
    if id(node) not in sizes:
        sizes[id(node)] = math.inf  # while it is being visited
        inner = (x for entry in node.value for x in (entry if isinstance(entry, tuple) else (entry,)))
        sizes[id(node)] = 1 + sum(_expanded_size(x, sizes) for x in inner)
    return sizes[id(node)]


def _duplicate_key(node: yaml.Node | None) -> str:
    """Return a duplicate key of a mapping, of which YAML uses the last value; empty if there is none."""
    stack = [node]
    while stack:
        node = stack.pop()
        if isinstance(node, yaml.MappingNode):
            keys = Counter((key.tag, key.value) for key, _ in node.value if isinstance(key, yaml.ScalarNode))
            if duplicate := next((key for (_, key), n in keys.items() if n > 1), ""):
                return str(duplicate)
            stack += [value for _, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            stack += node.value
    return ""
