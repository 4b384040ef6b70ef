"""Input files of CalculiX: nodes and node sets of ``job.inp`` and its included files, and stored matrices.

Keyword lines start with ``*`` and do not continue after a trailing comma, unlike in Abaqus; ``*NSET, ELSET=`` selects
the nodes of elements, as in Abaqus, while CalculiX 2.20 prints a warning. ``*INCLUDE, INPUT=mesh.inp`` is relative to
the folder of the job.

Source: G. Dhondt, CalculiX CrunchiX user's manual: input deck format, *NSET, *ELSET, *FREQUENCY.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from ...errors import InputError, UnknownNameError, printable
from ...system import Array

Card = tuple[str, dict[str, str], list[list[str]]]  # keyword, options, data rows
Sets = dict[str, list[int]]


def calculix(path: Path) -> tuple[Array, csr_array, csr_array, Sets]:
    """Return points (n, 3), mass and stiffness (3n, 3n), and indices of the nodes of each set of a job.

    Raises:
        InputError: for a missing, incomplete or inconsistent file.
    """
    position, sets = _mesh(path)
    columns, index = _columns_of_rows(path, position)
    M, K = (_symmetric(path.with_suffix(suffix), np.array(columns, int)) for suffix in (".mas", ".sti"))
    found = {name: [index[i] for i in dict.fromkeys(ids) if i in index] for name, ids in sets.items() if name}
    return np.array([position[number] for number in index]), M, K, found


def _columns_of_rows(path: Path, position: Mapping[int, object]) -> tuple[list[int], dict[int, int]]:
    """Return the displacement index of each row of the matrix files, and the indices of nodes by number."""
    rows = [_numbers(line.split("."), path.with_suffix(".dof")) for line in _text(path.with_suffix(".dof")).split()]
    index = {number: i for i, number in enumerate(sorted({row[0] for row in rows}))}
    columns = [3 * index[row[0]] + row[-1] - 1 for row in rows]
    if not columns:
        raise InputError(f"finite elements: {path.stem}.dof is empty")
    if len(set(columns)) < len(columns) or not position.keys() >= index.keys():
        text = f"{path.stem}.dof has displacements of nodes that {path.name} does not have"
        raise InputError(f"finite elements: {text}: CalculiX expands beams and shells; use solids")
    if len(columns) != 3 * len(index):
        missing = 3 * len(index) - len(columns)
        raise InputError(f"finite elements: {path.stem}.dof: {missing} displacements are fixed; store a free body")
    return columns, index


def _mesh(path: Path) -> tuple[dict[int, list[float]], Sets]:
    """Return positions of nodes by number, and the numbers of each node set by name."""
    position: dict[int, list[float]] = {}
    nodes, elements, corners = Sets(), Sets(), dict[int, list[int]]()
    for keyword, options, rows in _cards(list(_lines(path, path.parent, ()))):
        card = f"finite elements: {path.name}: *{keyword}"
        if keyword == "NODE":
            ids = [_numbers(row[:1], card)[0] for row in rows]
            position |= {i: _position(row, card) for i, row in zip(ids, rows, strict=True)}
            nodes.setdefault(options.get("NSET", ""), []).extend(ids)
        elif keyword == "ELEMENT":
            found = {x[0]: x[1:] for x in _elements(rows, options.get("TYPE", ""), card)}
            corners |= found
            elements.setdefault(options.get("ELSET", ""), []).extend(found)
        elif keyword in ("NSET", "ELSET"):
            if not options.get(keyword):
                raise InputError(f"{card} needs a name, {keyword} = ..")
            sets = nodes if keyword == "NSET" else elements
            members = list(_members(rows, "GENERATE" in options, sets, card))
            if keyword == "NSET" and "ELSET" in options:
                members += _nodes_of(options["ELSET"], elements, corners)
            sets.setdefault(options[keyword], []).extend(members)
    return position, nodes


def _lines(path: Path, folder: Path, including: tuple[Path, ...]) -> Iterator[str]:
    """Yield lines of a file and of included files, without comments."""
    if path.resolve() in including:
        raise InputError(f"finite elements: {path.name} includes itself")
    for line in _text(path).splitlines():
        text = line.strip()
        if re.match(r"\*\s*INCLUDE\b", text, re.IGNORECASE):
            name = text.partition("=")[2].strip().strip("\"'")
            yield from _lines(folder / name, folder, (*including, path.resolve()))
        elif text and not text.startswith("**"):
            yield text.upper()


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8-sig", errors="replace")


def _cards(lines: Sequence[str]) -> Iterator[Card]:
    """Yield the cards of the lines of an input file."""
    starts = [i for i, x in enumerate(lines) if x.startswith("*")]
    for i, end in pairwise([*starts, len(lines)]):
        keyword, *options = (x.strip() for x in lines[i][1:].split(","))
        rows = [[x.strip() for x in row.split(",") if x.strip()] for row in lines[i + 1 : end]]
        yield keyword, {y[0].strip(): y[-1].strip() for y in (x.split("=") for x in options)}, rows


def _numbers(words: Sequence[str], where: object) -> list[int]:
    """Return positive integers."""
    numbers = [int(x) if x.isascii() and x.isdigit() else 0 for x in words]
    if not words or not all(numbers):
        where = f"finite elements: {where.name}:" if isinstance(where, Path) else where
        raise InputError(f"{where} needs numbers from 1, got {', '.join(words)!r:.60}")
    return numbers


def _position(row: Sequence[str], card: str) -> list[float]:
    try:
        x = [float(word.replace("D", "E")) for word in row[1:4]]
    except ValueError:
        x = [np.nan]
    if not np.isfinite(x).all():
        raise InputError(f"{card} needs finite positions, got {', '.join(row)!r:.60}")
    return (x + [0.0] * 3)[:3]


def _elements(rows: Sequence[Sequence[str]], kind: str, card: str) -> Iterator[list[int]]:
    """Yield number and nodes of each element; nodes of solids may use several rows."""
    solid = re.match(r"C3D(\d+)", kind)
    number, entries = int(solid[1]) if solid else 0, list[int]()
    for row in rows:
        entries += _numbers(row, card)
        if len(entries) > number:
            yield entries
            entries = []


def _members(rows: Sequence[Sequence[str]], generate: bool, sets: Sets, card: str) -> Iterator[int]:
    for row in rows:
        if generate:
            first, last, step = (_numbers(row, card) * 2)[:2] + [1] if len(row) < 3 else _numbers(row[:3], card)
            yield from range(first, last + 1, step)
            continue
        for x in row:
            if x not in sets and not x.isdigit():
                raise UnknownNameError(f"set of {card.removeprefix('finite elements: ')}", x, [y for y in sets if y])
            yield from sets[x] if x in sets else _numbers([x], card)


def _nodes_of(name: str, elements: Sets, corners: dict[int, list[int]]) -> list[int]:
    if name not in elements:
        raise UnknownNameError("set of elements", name, [x for x in elements if x])
    return [node for i in elements[name] for node in corners.get(i, [])]


def _symmetric(path: Path, displacements: Array) -> csr_array:
    """Return a symmetric matrix of displacements from rows (i, j, value) of its upper triangle, i and j from 1."""
    n, text = len(displacements), _text(path)
    try:
        data = np.loadtxt(StringIO(text), ndmin=2) if text.strip() else np.empty((0, 3))
    except ValueError as e:
        raise InputError(f"finite elements: {path.name}: {printable(f'{e!s:.120}')}") from None
    if data.shape[1] != 3 or not np.isfinite(data).all():
        raise InputError(f"finite elements: {path.name} needs rows of three finite numbers: row, column, value")
    entries = data[:, :2]
    if not ((entries >= 1) & (entries <= n) & (entries == np.floor(entries))).all():
        raise InputError(f"finite elements: {path.name} has rows and columns other than 1 to {n}, as {path.stem}.dof")
    (i, j), x = entries.T.astype(int) - 1, data[:, 2]
    off_diagonal = i != j
    if missing := n - len(set(i[~off_diagonal].tolist())):
        raise InputError(f"finite elements: {path.name} is incomplete: {missing} of {n} diagonal entries are missing")
    rows, columns = np.concatenate([i, j[off_diagonal]]), np.concatenate([j, i[off_diagonal]])
    return csr_array((np.concatenate([x, x[off_diagonal]]), (displacements[rows], displacements[columns])), (n, n))
