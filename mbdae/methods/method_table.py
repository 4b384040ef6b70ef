"""Methods by name, shown as a table."""

from typing import Any

from .coupled_method import CoupledMethod


def summary(method: Any) -> dict[str, Any]:
    """Return the claimed orders and the cost of a method, by heading; None for entries that do not apply.

    "order" is the order of q, v and lam in index 2, "f linear in z" the order for mechanisms, "own lam" the order of
    the multipliers of the method; "solves" are linear solves per step; "assumptions" are its simplifying assumptions.
    """
    from .order.assumptions import assumptions

    coupled = isinstance(method, CoupledMethod)
    return {
        "name": method.name,
        "family": method.family,
        "order": method.order,
        "f linear in z": method.order_linear,
        "own lam": method.order_own,
        "embedded": method.order_embedded or None,
        "solves": method.solves,
        "assumptions": assumptions(method).implicit if coupled else None,
        "R(inf)": float(method.R_infinity) if coupled else None,
        "title": method.title,
    }


class MethodTable(dict[str, Any]):
    """Methods by name; its representation is a table of `summary`."""

    def _cells(self) -> list[list[str]]:
        rows = [summary(method) for method in self.values()]
        return [list(rows[0]) if rows else [], *(["-" if x is None else str(x) for x in row.values()] for row in rows)]

    def __repr__(self) -> str:
        from ..tabular import align_columns

        return "\n".join(align_columns(self._cells()))

    def _repr_html_(self) -> str:
        """HTML representation in notebooks."""
        from ..tabular import table

        return table(self._cells())
