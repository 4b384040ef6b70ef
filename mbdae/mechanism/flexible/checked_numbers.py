"""Checks of numbers of flexible bodies; messages of one line name the number, valid values and the given value."""

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arguments import as_numbers
from ...errors import InputError, UnknownNameError
from ...system import Array
from ...tolerances import SOLUTION_ROUNDING

if TYPE_CHECKING:
    from .modal_body import Node

NODE_SHAPES = {"r": "3", "Phi": "3k", "Psi": "3k", "Phi2": "3kk", "strain": "k"}
SYMMETRIC = {  # pairs of axes
    "I0": ((0, 1),), "Mq": ((0, 1),), "I1": ((1, 2),), "I2": ((0, 1), (2, 3)), "C2": ((1, 2),), "H2": ((2, 3),),
    "Mq1": ((0, 1),), "Mq2": ((0, 1), (2, 3)),
}  # fmt: skip


def real(value: Any, what: str, positive: bool = False) -> float:
    """Return a finite number that is not negative, or positive.

    Raises:
        InputError: for other values.
    """
    a = as_array(value)
    if a.ndim or not (a > 0 if positive else a >= 0):
        needed = "a positive number" if positive else "a number that is not negative"
        raise InputError(f"{what} needs {needed}, got {value!r:.60}")
    return float(a)


def integer(value: Any, what: str, minimum: int) -> int:
    """Return an integer of at least ``minimum``.

    Raises:
        InputError: for other values.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer) or value < minimum:
        raise InputError(f"{what}: expected a whole number from {minimum}, got {value!r:.60}")
    return int(value)


def as_array(value: Any) -> Array:
    """Return an array of finite numbers; a scalar nan for other values."""
    a = as_numbers(value)
    return a if np.isfinite(a).all() else np.array(np.nan)


def array(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """Return an array of finite numbers with the given shape.

    Raises:
        InputError: for another shape, or other values.
    """
    a = as_array(value)
    if a.shape != shape or not np.isfinite(a).all():
        raise InputError(f"{what}: expected finite numbers of shape {shape}, got {describe(value)}")
    return a


def describe(value: Any) -> str:
    """Return a description of a value for messages: shape of an array and whether it is finite, or the value."""
    try:
        a = np.asarray(value, float)
    except (TypeError, ValueError):
        return f"{value!r:.60}"
    return f"shape {a.shape}" if np.isfinite(a).all() else f"shape {a.shape}, not all finite"


def damping_coefficients(ratios: Any, stiffness: Array, Mq: Array, what: str = "flexible body") -> Array:
    """Return 2 zeta_i sqrt(k_i m_i), (k,), in N s/m, from damping ratios zeta of each mode, or one for all modes.

    Raises:
        InputError: for negative ratios, or a wrong number of ratios.
    """
    k, zeta = len(stiffness), as_array(ratios)
    if zeta.shape not in ((), (k,)) or not (zeta >= 0).all():
        got = ratios.tolist() if isinstance(ratios, np.ndarray) else ratios
        needed = f"one ratio that is not negative, or {k}, of all modes with those of loads"
        raise InputError(f"{what}: damping needs {needed}; got {got!r:.60}")
    return 2 * zeta * np.sqrt(stiffness * np.diagonal(Mq))


def require_loads(loads: Any, known: Collection[str]) -> None:
    """Reject unknown or repeated loads.

    Raises:
        InputError: for a text instead of a list, or a repeated load.
        UnknownNameError: for an unknown load.
    """
    if isinstance(loads, str):
        raise InputError(f"loads must be a list, loads = [{loads!r}]")
    for i, load in enumerate(loads):
        if load not in known:
            raise UnknownNameError("load", load, known)
        if load in loads[:i]:
            raise InputError(f"load {load!r} is given twice")


def require_symmetric(a: Array, what: str, *axes: tuple[int, int]) -> None:
    """Reject an array that is not symmetric in the pairs of axes.

    Raises:
        InputError: for other values.
    """
    size = SOLUTION_ROUNDING * np.abs(a).max(initial=0.0)
    if any(np.abs(a - a.swapaxes(*pair)).max(initial=0.0) > size for pair in axes):
        raise InputError(f"{what} must be symmetric" + ("" if a.ndim == 2 else " in its modes and directions"))


def require_positive(M: Array, what: str) -> None:
    """Reject a symmetric matrix with negative eigenvalues.

    Raises:
        InputError: for other values.
    """
    sizes = np.sqrt(np.abs(np.diagonal(M)))
    sizes[sizes == 0] = max(sizes.max(initial=0.0), 1.0)
    if len(M) and np.linalg.eigvalsh(M / np.outer(sizes, sizes))[0] < -SOLUTION_ROUNDING * len(M):
        raise InputError(f"{what}: no body has these masses, whose kinetic energy could be negative")


def require_names(names: Any, what: str) -> None:
    """Reject names that are not a list of different texts.

    Raises:
        InputError: for another type, an empty or a repeated name.
    """
    if not isinstance(names, Sequence) or isinstance(names, str) or not all(isinstance(x, str) and x for x in names):
        raise InputError(f"{what}: nodes need names, got {names!r:.60}")
    if twice := [x for i, x in enumerate(names) if x in names[:i]]:
        raise InputError(f"{what}: the node {twice[0]!r} is given twice")


def require_nodes(nodes: "Mapping[str, Node]", k: int, what: str) -> None:
    """Reject nodes that do not fit k modes.

    Raises:
        InputError: for invalid values or shapes, an empty name, or a negative modulus.
    """
    if not isinstance(nodes, Mapping) or not all(hasattr(node, "Psi") for node in nodes.values()):
        raise InputError(f"{what}: nodes are Node objects by name, got {nodes!r:.60}")
    require_names(list(nodes), what)
    for name, node in nodes.items():
        prefix = f"{what}: node {name!r}: "
        for x, letters in NODE_SHAPES.items():
            if (value := getattr(node, x)) is not None:
                array(value, prefix + x, tuple(k if c == "k" else 3 for c in letters))
        if node.Phi2 is not None:
            require_symmetric(np.asarray(node.Phi2), prefix + "Phi2", (1, 2))
        real(node.modulus, prefix + "modulus")


def checked_points(r: Array, masses: Any, Phi: Array, stiffness: Array) -> tuple[Array, Any, Array, Array]:
    """Return checked points, masses, displacements and stiffness for `ModalBody.of_points`.

    Raises:
        InputError: for wrong shapes, masses that no body has, or stiffness that is not positive.
    """
    m = masses if hasattr(masses, "tocsr") else as_array(masses)  # sparse
    n, k = m.shape[0] if m.ndim else 0, np.size(stiffness)
    if m.shape not in ((n,), (n, n)):
        raise InputError(f"flexible body: masses: expected finite numbers (n,) or (n, n), got {describe(masses)}")
    arrays = {"points": (r, (n, 3)), "modes": (Phi, (n, 3, k)), "stiffness": (stiffness, (k,))}
    r, P, K = (array(x, f"flexible body: {name}", shape) for name, (x, shape) in arrays.items())
    diagonal = m if m.ndim == 1 else m.diagonal()
    if not (diagonal >= 0).all() or not m.sum() > 0:
        raise InputError(f"flexible body: masses must not be negative, and not all zero, got {diagonal.min():g} kg")
    if m.ndim == 2:
        if abs(m - m.T).max() > SOLUTION_ROUNDING * abs(m).max():
            raise InputError("flexible body: the mass matrix must be symmetric")
        x = np.column_stack([np.ones(n), r, P.reshape(n, -1)])  # all motions are linear in these columns
        require_positive(x.T @ (m @ x), "flexible body")
    if not (K > 0).all():
        raise InputError(f"flexible body: modes need positive stiffness, got {K.min():g} N/m")
    return r, m, P, K
