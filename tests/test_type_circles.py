"""Structure: files that know each other's types."""

import ast
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / "mbdae").rglob("*.py"))
MOST = 6
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef


def imports(path):
    """Modules and names that a file imports outside of functions, also those for type checkers only."""
    package, nodes = path.relative_to(ROOT).parts[:-1], [ast.parse(path.read_text())]
    while nodes:
        node = nodes.pop()
        nodes += [inner for inner in ast.iter_child_nodes(node) if not isinstance(inner, FUNCTIONS)]
        if isinstance(node, ast.ImportFrom) and node.level:
            stem = [*package[: len(package) - node.level + 1], *(node.module or "").split(".")]
            base = ".".join(filter(None, stem))
            yield from (f"{base}.{alias.name}" for alias in node.names)


def circles(files):
    """Sizes of the groups of files that import each other, in circles."""
    number = {}
    for k, path in enumerate(files):
        parts = path.relative_to(ROOT).with_suffix("").parts
        number[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = k
    edges = []
    for k, path in enumerate(files):
        found = set()
        for name in imports(path):
            found.add(number.get(name, number.get(name.rpartition(".")[0], k)))
        edges += [(k, other) for other in found - {k}]
    i, j = np.array(edges).T
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(len(files), len(files)))
    sizes = np.bincount(connected_components(graph, connection="strong")[1])
    return sorted(sizes[sizes > 1].tolist())


def test_few_files_know_each_others_types():
    found = circles(FILES)
    assert 3 in found, "a step of a tableau and the tableau"
    assert len(found) <= MOST
