"""Modal bodies as arrays: files ``.npz``, and tables of archives.

Arrays as in `ModalBody`: mass, s0 (3,), I0 (3, 3), C, H0 (3, k), Mq (k, k), Hj (k, 3, k), I1 (k, 3, 3),
I2 (k, k, 3, 3), stiffness, damping (k,), and optional C2, H2, Mq1, Mq2 of second order; of n nodes: names
(n,), r (n, 3), Phi, Psi (n, 3, k), Phi2 (n, 3, k, k), strain (n, k), modulus (n,); and of the outline "outline r"
(p, 3), "outline Phi", "outline Psi" (p, 3, k), "outline Phi2" (p, 3, k, k).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array
from ...tolerances import SOLUTION_ROUNDING
from .checked_numbers import (
    NODE_SHAPES,
    SYMMETRIC,
    array,
    damping_coefficients,
    real,
    require_names,
    require_nodes,
    require_positive,
    require_symmetric,
)
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
        InputError: for a suffix other than ``.npz``, or an unwritable file.
    """
    if Path(path).suffix != ".npz":
        raise InputError(f"modal bodies are written to .npz files, got {path}")
    arrays: dict[str, Any] = {name: np.array(x) for name, x in modal_data(body).items()}
    try:
        np.savez(path, **arrays)
    except OSError as e:
        raise InputError(f"cannot write {path}: {e.strerror or e}") from None


def read_modal_data(path: Path) -> dict[str, Any]:
    """Return the numbers of a file.

    Raises:
        InputError: for a file that `save_modal_body` did not write.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name].tolist() for name in file.files}
    except (ValueError, OSError, BadZipFile, EOFError) as e:
        raise InputError(f"{path.name} is not a file of a modal body: {e}") from None


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


def modal_body_from_data(
    data: Mapping[str, Any],
    name: str,
    modes: int | None = None,
    damping: float | Sequence[float] | None = None,
) -> ModalBody:
    """Return a modal body from its numbers.

    Args:
        data: numbers as returned by `modal_data`.
        name: name of the body, for messages.
        modes: number of modes to use, the first ones; all if omitted.
        damping: damping ratio of each mode, or one for all modes, instead of the damping of the data.

    Raises:
        InputError: for missing numbers, wrong shapes, impossible numbers of an elastic body, or too many modes.
    """
    _require_known(data, name)
    prefix = f"flexible body {name!r}"
    require_names(data["names"], prefix)
    sizes = {"k": np.size(data["stiffness"]), "n": len(data["names"]), "3": 3}
    sizes["p"], shapes = len(np.atleast_1d(data.get("outline r", ()))), {**SHAPES, **OPTIONAL}
    arrays = {x: array(data[x], f"{prefix}: {x}", tuple(sizes[c] for c in shapes[x])) for x in data if x != "names"}
    _check(arrays, prefix)
    arrays = _first_modes(arrays, sizes["k"] if modes is None else modes, prefix)
    if damping is not None:
        arrays["damping"] = damping_coefficients(damping, arrays["stiffness"], arrays["Mq"], prefix)
    nodes = {
        node: Node(**{x: arrays[x][i] for x in NODE_SHAPES if x in arrays},
                   modulus=float(arrays["modulus"][i]) if "modulus" in arrays else 0.0)
        for i, node in enumerate(data["names"])
    }  # fmt: skip
    require_nodes(nodes, len(arrays["stiffness"]), prefix)
    rest = {x: a for x, a in arrays.items() if x not in (*NODE_SHAPES, *OUTLINE, "modulus", "mass")}
    return ModalBody(mass=float(arrays["mass"]), nodes=nodes, outline=_outline(arrays, prefix), **rest)


def _outline(arrays: Mapping[str, Array], prefix: str) -> OutlinePoints | None:
    given = {x.split()[1]: arrays[x] for x in OUTLINE if x in arrays}
    if given and not {"r", "Phi"} <= set(given):
        raise InputError(f"{prefix}: an outline has 'outline r' and 'outline Phi'")
    return OutlinePoints(**given) if given else None


def _first_modes(arrays: Mapping[str, Array], k: int, prefix: str) -> dict[str, Array]:
    """Return the numbers of the first k modes."""
    if k > (count := len(arrays["stiffness"])):
        raise InputError(f"{prefix} has {count} modes, got modes = {k}")
    shapes, first = {**SHAPES, **OPTIONAL}, {"k": slice(k)}
    return {x: a[tuple(first.get(c, slice(None)) for c in shapes[x])] for x, a in arrays.items()}


def _require_known(data: Mapping[str, Any], name: str) -> None:
    needed, known = (*SHAPES, "names"), (*SHAPES, *OPTIONAL, "names")
    if missing := [x for x in needed if x not in data]:
        raise InputError(f"flexible body {name!r}: {missing[0]!r} is missing; a modal body has {', '.join(needed)}")
    if unknown := [x for x in data if x not in known]:
        raise InputError(f"flexible body {name!r}: unknown numbers {unknown[0]!r}; valid: {', '.join(known)}")


def _check(arrays: Mapping[str, Array], prefix: str) -> None:
    """Reject masses that no body has, and springs or dampers that are not passive."""
    real(arrays["mass"], f"{prefix}: mass", positive=True)
    if not (arrays["stiffness"] > 0).all() or not (arrays["damping"] >= 0).all():
        raise InputError(f"{prefix}: stiffness must be positive and damping not negative")
    for x, axes in SYMMETRIC.items():
        if x in arrays:
            require_symmetric(arrays[x], f"{prefix}: {x}", *axes)
    if len(arrays["Mq"]) and not np.linalg.eigvalsh(arrays["Mq"])[0] > 0:
        raise InputError(f"{prefix}: Mq must be positive definite")
    m, X, C, H = arrays["mass"], pin.skew(arrays["s0"]), arrays["C"], arrays["H0"]
    undeformed = np.block([[m * np.eye(3), -X, C], [X, arrays["I0"], H], [C.T, H.T, arrays["Mq"]]])
    require_positive(undeformed, prefix)
    moments = np.linalg.eigvalsh(arrays["I0"] + X @ X / m)
    if moments[2] > moments[:2].sum() + SOLUTION_ROUNDING * moments[2]:
        raise InputError(f"{prefix}: no body has the moments of inertia {', '.join(f'{x:g}' for x in moments)} kg m^2")
