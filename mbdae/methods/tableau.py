"""A half-explicit Runge-Kutta method as data: exact coefficients, claims, and derived properties."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..data_types import JsonObject
from ..errors import InputError, is_count
from ..system import State, Step, System
from ..tolerances import EPS
from .controller import PI
from .exact_numbers import Number, exact
from .half_explicit_step import half_explicit_step, step_doubling

Row = list[Number]
Text = tuple[str, ...]


@dataclass(frozen=True)
class Tableau:
    """Coefficients of a half-explicit Runge-Kutta method for y' = f(t, y, z), 0 = g(t, y).

    Stage i = 1..n computes, with F_j = f(t_j, Y_j, Z_j),

        Y_i    = y_0 + h sum_{j<i}  a_ij F_j
        Yhat_i = y_0 + h sum_{j<=i} ahat_ij F_j,    Z_i such that g(t_0 + chat_i h, Yhat_i) = 0

    and y_1 = y_0 + h sum b_i F_i. In HERK methods ahat_i = a_{i+1} (the last row is b). In PHERK methods the
    first row of Ahat is zero: Z_1 = z_0 is carried, and an extra stage n = s + 1 with Y_n = y_1 gives z_1 and
    the next step's first stage.

    Entries are text (``"1/2"``, ``"0.25"``, ``"1/6 - sqrt(3)/108"``), fractions or numbers, whose value is exactly
    the decimal that Python prints; a table may also be one string with one row per line. If claims are left out,
    `mbdae.methods.method` derives them from the order conditions, up to order 5.

    Args:
        name: name typed by the user, for instance ``"pherk5"``.
        title: one line for a list of methods.
        reference: where the coefficients were published, or who derived them.
        A: rows of the coefficients a_ij as text, lower triangle (zeros above may be left out).
        b: weights as text, without an entry for the extra stage.
        Ahat: rows of ahat_ij as text; left out for HERK.
        order: claimed order of y (q and v) for general f.
        order_linear: claimed order of y when f is linear in z, as in mechanics; left out if the same.
        order_own: claimed order of the z of the method (lam_own).
        order_ode: claimed order of y without constraints, y' = f(t, y): the order of A and b as an explicit method;
            left out if it is ``order``.
        b_embedded: weights of the embedded formula over the n stages, as text; empty if there is none.
        b_companion: weights of a second embedded formula, one order lower (see `mbdae.methods.controller`).
        order_embedded: order of the embedded formula, after projection if `project_embedded`.
        project_embedded: whether the embedded solution violates 0 = g, and is projected onto it for the error estimate.
        rounded: whether coefficients are rounded decimals: conditions hold to about 1e-24, not exactly.

    Raises:
        InputError: for entries that are not exact numbers, or coefficients that are not those of a half-explicit
            method.
    """

    name: str
    title: str = ""
    reference: str = ""
    A: tuple[Text, ...] = field(repr=False, kw_only=True)
    b: Text = field(repr=False, kw_only=True)
    order: int = 0
    order_own: int = 0
    Ahat: tuple[Text, ...] = field(default=(), repr=False)
    order_linear: int = 0
    order_ode: int = 0
    b_embedded: Text = field(default=(), repr=False)
    b_companion: Text = field(default=(), repr=False)
    order_embedded: int = 0
    project_embedded: bool = False
    rounded: bool = False

    excludes: ClassVar[Mapping[str, str]] = {}
    in_core = True  # the compiled core takes its steps
    control = PI
    roundings = 0  # per step, in sums without compensation
    position_pivot = np.inf  # stages do not divide position residuals by h^2
    blend = 1.0  # exponent p for two error estimates, see `mbdae.methods.controller.error_norm`

    def __post_init__(self) -> None:
        for key, order in vars(self).items():
            if key.startswith("order") and not is_count(order, 0):
                raise InputError(f"tableau {self.name!r}: {key} is a whole number, not negative, got {order!r:.60}")
        for key in ("A", "Ahat"):
            object.__setattr__(self, key, _texts(self.name, key, getattr(self, key)))
        for key in ("b", "b_embedded", "b_companion"):
            rows = _texts(self.name, key, [getattr(self, key)])
            object.__setattr__(self, key, rows[0] if rows else ())
        self._check_shape()
        for key in ("order_linear", "order_ode"):
            object.__setattr__(self, key, getattr(self, key) or self.order)

    def _check_shape(self) -> None:
        n = len(self.A)
        if max(map(len, (*self.A, *self.Ahat, self.b, self.b_embedded, self.b_companion))) > n:
            raise InputError(f"tableau {self.name!r}: a row has more than {n} entries, one for each stage")
        A, Ahat, first = self.exact_A, self.exact_Ahat, int(self.explicit_first)
        lower = len(Ahat) == n and _is_lower(A, 0) and _is_lower(Ahat, 1)
        if not (lower and all(Ahat[i][i] for i in range(first, n)) and self.exact_b in Ahat[first:]):
            shape = "A strictly lower, Ahat lower with a nonzero diagonal, b a row of Ahat"
            raise InputError(f"tableau {self.name!r}: {shape}")
        if not np.isfinite(self.noise):
            raise InputError(f"tableau {self.name!r}: its weights divided by the diagonal of Ahat overflow")

    @cached_property
    def exact_A(self) -> list[Row]:
        """Exact A, (n, n)."""
        return [_row(r, len(self.A)) for r in self.A]

    @cached_property
    def exact_b(self) -> Row:
        """Exact weights padded to the n stages, (n,)."""
        return _row(self.b, len(self.A))

    @cached_property
    def exact_Ahat(self) -> list[Row]:
        """Exact Ahat, (n, n); for HERK the rows 2 to n of A, and b."""
        if self.Ahat:
            return [_row(r, len(self.A)) for r in self.Ahat]
        return [*self.exact_A[1:], self.exact_b]

    @cached_property
    def explicit_first(self) -> bool:
        """Whether the first stage is known from the previous step (PHERK, Arnold)."""
        return bool(self.Ahat) and not any(self.exact_Ahat[0])

    @property
    def carries(self) -> bool:
        """Whether a step uses more than the end point of the previous step."""
        return self.explicit_first

    @property
    def family(self) -> str:
        """``"HERK"``, or ``"Arnold"`` (Ahat is A shifted) or ``"PHERK"`` for an explicit first stage."""
        if not self.explicit_first:
            return "HERK"
        n = len(self.A)
        return "Arnold" if self.exact_Ahat[1 : n - 1] == self.exact_A[2:] else "PHERK"

    @property
    def solves(self) -> int:
        """Linear solves per step: the stages with a constraint."""
        return len(self.A) - int(self.explicit_first)

    @property
    def smallest_pivot(self) -> float:
        """Pivot p = min |ahat_ii| over constrained stages; the rounding error of the z of the method is eps / (p h)."""
        return min(abs(float(self.exact_Ahat[i][i])) for i in range(int(self.explicit_first), len(self.A)))

    @cached_property
    def noise(self) -> float:
        """Rounding error of an error estimate of v, relative to |v|: 2 eps sum_i |e_i / ahat_ii|, or with b_i for e_i.

        A stage computes v' = -G v / (h ahat_ii) + ..., which has the rounding error eps |v| / (h ahat_ii).
        """
        first, diagonal = int(self.explicit_first), [row[i] for i, row in enumerate(self.exact_Ahat)]
        weights, *_ = *self._error_weights, self.exact_b
        with np.errstate(over="ignore"):
            return float(2 * EPS * np.abs(_float(weights[first:]) / _float(diagonal[first:])).sum())

    @property
    def _error_weights(self) -> list[Row]:
        """Exact weights of the error estimates, of no, one or two embedded formulas, (n,) each."""
        rows = [_row(w, len(self.A)) for w in (self.b_embedded, self.b_companion) if w]
        return [[w - b for w, b in zip(row, self.exact_b, strict=True)] for row in rows]

    @property
    def error_power(self) -> int:
        """Power of h in the error estimate of `controlled_step`: embedded order + 1, one more with a companion.

        From errors of size h^(p+1) and, for the companion, h^p the estimate err_1^2 / (err_1 + 0.01 err_2) is of size
        h^(p+2). Without an embedded formula, step doubling yields the local error of the method, h^(p+1).
        """
        return self.order_embedded + 1 + bool(self.b_companion) if self.b_embedded else self.order + 1

    def min_growth(self, ny: int) -> float:
        """Return the factor below which growth of h is suppressed: 1, since no data depend on h."""
        return 1.0

    def compiled(self, native: Any) -> Any:
        """Return the method for the compiled core."""
        return self.arrays.compiled(
            native,
            explicit_first=bool(self.explicit_first),
            project_embedded=bool(self.project_embedded),
            doubling_order=0 if self.b_embedded else self.order,
            noise=self.noise,
        )

    def to_dict(self) -> JsonObject:
        """Return the entries as JSON data, from which `mbdae.methods.custom_tableau.tableau` recreates it."""
        return {key: value for key, value in asdict(self).items() if value}

    def step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take one step; see `mbdae.methods.half_explicit_step.half_explicit_step`."""
        return system.compiled_step(self, t, h, state) or half_explicit_step(system, self, t, h, state)

    def controlled_step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take one step with an error estimate: from the embedded formula, or from two half steps."""
        if self.b_embedded:
            return self.step(system, t, h, state)
        return step_doubling(self.step, self.order, system, t, h, state)

    @cached_property
    def arrays(self) -> "ButcherArrays":
        """Coefficients in double precision, rounded once from the exact ones."""
        c = [sum(r, start=exact("0")) for r in self.exact_A]
        chat = [sum(r, start=exact("0")) for r in self.exact_Ahat]
        A, Ahat, b = _float(self.exact_A), _float(self.exact_Ahat), _float(self.exact_b)
        return ButcherArrays(A, Ahat, b, _float(c), _float(chat), _float(self._error_weights).reshape(-1, len(self.A)))


@dataclass(frozen=True)
class ButcherArrays:
    """Double-precision A (n, n), Ahat (n, n), b (n,), c (n,), chat (n,), error weights e (0 to 2, n)."""

    A: np.ndarray
    Ahat: np.ndarray
    b: np.ndarray
    c: np.ndarray
    chat: np.ndarray
    e: np.ndarray

    def compiled(self, native: Any, **settings: Any) -> Any:
        """Return these coefficients for the compiled core, with further settings of the method."""
        return native.Tableau(
            A=self.A, Ahat=self.Ahat, b=self.b, c=self.c, chat=self.chat, error_weights=self.e, **settings
        )


def _row(text: Text, n: int) -> Row:
    row: Row = [exact(x) for x in text]
    return row + [exact("0")] * (n - len(row))


def _is_lower(rows: list[Row], diagonal: int) -> bool:
    """Return whether entries on and above a diagonal are zero; 0: the main diagonal, 1: the one above it."""
    return not any(any(row[i + diagonal :]) for i, row in enumerate(rows))


def _texts(name: str, key: str, table: Any) -> tuple[Text, ...]:
    """Return rows of coefficients as text, from rows of texts, fractions and numbers, or one text.

    Raises:
        InputError: if an entry is not an exact number.
    """
    table = table.strip().splitlines() if isinstance(table, str) else table
    out: list[Text] = []
    for row in table:
        entries = row.split() if isinstance(row, str) else [str(x) for x in row]
        for entry in entries:
            try:
                exact(entry)
            except ValueError:
                text = f"tableau {name!r}, {key}: expected exact numbers, 1/2, 0.25 or 1/6 - sqrt(3)/108"
                raise InputError(f"{text}, got {entry!r:.60}") from None
        out.append(tuple(entries))
    return tuple(out)


def _float(x: list) -> np.ndarray:
    return np.array([[float(v) for v in r] if isinstance(r, list) else float(r) for r in x])
