"""Modal bodies as plain numbers: files ``.npz``, and tables of archives.

Arrays as in `ModalBody`: mass, s0 (3,), I0 (3, 3), C, H0 (3, k), Mq (k, k), Hj (k, 3, k), I1 (k, 3, 3),
I2 (k, k, 3, 3), stiffness, damping (k,), of second order C2, H2, Mq1, Mq2 if given; of n nodes: names
(n,), r (n, 3), Phi, Psi (n, 3, k), Phi2 (n, 3, k, k), strain (n, k), modulus (n,); and of the outline "outline r"
(p, 3), "outline Phi", "outline Psi" (p, 3, k), "outline Phi2" (p, 3, k, k).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from ...errors import InputError
from ...system import Array
from ...tolerances import SOLUTION_ROUNDING
from .modal_body import SECOND_ORDER, ModalBody, Node
from .points import OutlinePoints

SHAPES = {
    "mass": "", "s0": "3", "I0": "33", "C": "3k", "H0": "3k", "Mq": "kk", "Hj": "k3k", "I1": "k33", "I2": "kk33",
    "stiffness": "k", "damping": "k", "r": "n3", "Phi": "n3k", "Psi": "n3k",
}  # fmt: skip
OUTLINE = {"outline r": "p3", "outline Phi": "p3k", "outline Psi": "p3k", "outline Phi2": "p3kk"}
OPTIONAL = {**SECOND_ORDER, "Phi2": "n3kk", "strain": "nk", "modulus": "n", **OUTLINE}


def save_modal_body(body: ModalBody, path: str | Path) -> None:
    """Write a modal body to a file, for ``file = "rod.npz"`` of a table ``[[flexible]]``.

    Raises:
        InputError: for another suffix than ``.npz``.
    """
    if Path(path).suffix != ".npz":
        raise InputError(f"modal bodies are written to .npz files, got {path}")
    arrays: dict[str, Any] = {name: np.array(x) for name, x in modal_data(body).items()}
    np.savez(path, **arrays)


def read_modal_data(path: Path) -> dict[str, Any]:
    """Return the numbers of a file.

    Raises:
        InputError: for a file that is none of `save_modal_body`.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name].tolist() for name in file.files}
    except (ValueError, OSError, BadZipFile, EOFError) as e:
        raise InputError(f"{path.name} is no file of a modal body: {e}") from None


def modal_data(body: ModalBody) -> dict[str, Any]:
    """Return a modal body as numbers and lists."""
    out = {name: getattr(body, name) for name in ("mass", *SHAPES, *SECOND_ORDER) if hasattr(body, name)}
    nodes = list(body.nodes.values())
    for name in ("r", "Phi", "Psi", "Phi2", "strain", "modulus"):
        values = [getattr(node, name) for node in nodes]
        if nodes and all(x is not None for x in values):
            out[name] = np.array(values)
    out["names"] = list(body.nodes)
    if body.outline is not None:
        out |= {name: getattr(body.outline, name.split()[1]) for name in OUTLINE}
    return {name: np.asarray(x).tolist() for name, x in out.items() if x is not None}


def modal_body_from_data(data: Mapping[str, Any], name: str) -> ModalBody:
    """Return a modal body from its numbers.

    Args:
        data: as of `modal_data`.
        name: of the body, for messages.

    Raises:
        InputError: for missing numbers, wrong shapes, or numbers that no elastic body has.
    """
    _require_known(data, name)
    arrays = {x: _array(data[x], x, name) for x in data if x != "names"}
    sizes = {
        "k": np.size(arrays["stiffness"]),
        "n": len(data["names"]),
        "3": 3,
        "p": len(np.atleast_1d(arrays.get("outline r", ()))),
    }
    for x, a in arrays.items():
        shape = tuple(sizes[c] for c in {**SHAPES, **OPTIONAL}[x])
        if a.shape != shape:
            raise InputError(f"flexible body {name!r}: {x} needs the shape {shape}, got {a.shape}")
    _check(arrays, name)
    of_nodes = ("r", "Phi", "Psi", "Phi2", "strain")
    nodes = {
        node: Node(**{x: arrays[x][i] for x in of_nodes if x in arrays},
                   modulus=float(arrays["modulus"][i]) if "modulus" in arrays else 0.0)
        for i, node in enumerate(data["names"])
    }  # fmt: skip
    rest = {x: a for x, a in arrays.items() if x not in (*of_nodes, *OUTLINE, "modulus", "mass")}
    return ModalBody(mass=float(arrays["mass"]), nodes=nodes, outline=_outline(arrays, name), **rest)


def _outline(arrays: Mapping[str, Array], name: str) -> OutlinePoints | None:
    given = {x.split()[1]: arrays[x] for x in OUTLINE if x in arrays}
    if given and not {"r", "Phi"} <= set(given):
        raise InputError(f"flexible body {name!r}: an outline has 'outline r' and 'outline Phi'")
    return OutlinePoints(**given) if given else None


def _require_known(data: Mapping[str, Any], name: str) -> None:
    needed, known = (*SHAPES, "names"), (*SHAPES, *OPTIONAL, "names")
    if missing := [x for x in needed if x not in data]:
        raise InputError(f"flexible body {name!r}: {missing[0]!r} is missing; a modal body has {', '.join(needed)}")
    if unknown := [x for x in data if x not in known]:
        raise InputError(f"flexible body {name!r}: unknown numbers {unknown[0]!r}; valid: {', '.join(known)}")


def _array(value: Any, what: str, name: str) -> Array:
    try:
        a = np.array(value, float)
    except (TypeError, ValueError):
        a = np.array(np.nan)
    if not np.isfinite(a).all():
        raise InputError(f"flexible body {name!r}: {what} needs finite numbers in rows of equal length")
    return a


def _check(arrays: Mapping[str, Array], name: str) -> None:
    """Require a positive definite mass matrix of the straight body, and springs and dampers that are passive."""
    if not arrays["mass"] > 0:
        raise InputError(f"flexible body {name!r}: the mass is positive, got {float(arrays['mass']):g} kg")
    if not (arrays["stiffness"] > 0).all() or not (arrays["damping"] >= 0).all():
        raise InputError(f"flexible body {name!r}: stiffness is positive and damping not negative")
    for x in ("I0", "Mq"):
        a = arrays[x]
        if np.abs(a - a.T).max(initial=0.0) > SOLUTION_ROUNDING * np.abs(a).max(initial=0.0):
            raise InputError(f"flexible body {name!r}: {x} is symmetric")
    if len(arrays["Mq"]) and not np.linalg.eigvalsh(arrays["Mq"])[0] > 0:
        raise InputError(f"flexible body {name!r}: Mq is positive definite")
