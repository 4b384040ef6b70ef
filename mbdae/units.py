"""Units that users choose for files and results in place of SI units, and their factors.

A unit is a string, ``"N m/rad"``: symbols with powers, separated by spaces, and the denominator after a slash.
All computations are in SI units with angles in rad; numbers in files are converted when they are read, results when
they are shown.
"""

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NamedTuple

from .errors import InputError, UnknownNameError


class Factor(NamedTuple):
    """A factor ratio pi^pi_power; decimal fractions stay exact, so that 120 mm equals 0.12 m to the last bit."""

    ratio: Fraction
    pi_power: int = 0

    def power(self, k: int) -> "Factor":
        """Return the k-th power."""
        return Factor(self.ratio**k, self.pi_power * k)

    def times(self, other: "Factor") -> "Factor":
        """Return the product."""
        return Factor(self.ratio * other.ratio, self.pi_power + other.pi_power)

    def apply(self, x: Any) -> Any:
        """Return x times the factor; numbers and arrays."""
        if self == ONE:
            return x
        y = x * float(self.ratio.numerator) / float(self.ratio.denominator)
        return y * math.pi**self.pi_power if self.pi_power else y


ONE = Factor(Fraction(1))


def _named(**units: "str | int") -> dict[str, Factor]:
    return {name: Factor(Fraction(x)) for name, x in units.items()}


DIMENSIONS: dict[str, dict[str, Factor]] = {  # dimension: units by name in SI units, the SI unit first
    "length": _named(m=1, mm="1/1000", cm="1/100", um="1/1000000", km=1000) | {"in": Factor(Fraction("0.0254"))}
    | _named(ft="0.3048"),
    "angle": _named(rad=1, mrad="1/1000") | {"deg": Factor(Fraction(1, 180), 1), "rev": Factor(Fraction(2), 1)},
    "mass": _named(kg=1, g="1/1000", t=1000, lb="0.45359237"),
    "time": _named(s=1, ms="1/1000", min=60, h=3600),
    "force": _named(N=1, mN="1/1000", kN=1000, MN=1000000, kgf="9.80665", lbf="4.4482216152605"),
    "torque": {"N m": ONE, "N mm": Factor(Fraction(1, 1000)), "N cm": Factor(Fraction(1, 100)),
               "kN m": Factor(Fraction(1000)), "lbf in": Factor(Fraction("0.1129848290276167")),
               "lbf ft": Factor(Fraction("1.3558179483314004"))},
    "rotation": {"rad/s": ONE, "rpm": Factor(Fraction(1, 30), 1)},
    "pressure": {"N/m^2": ONE} | _named(Pa=1, kPa=1000, MPa=1000000, GPa=1000000000, bar=100000),
    "energy": _named(J=1, mJ="1/1000", kJ=1000),
    "power": _named(W=1, mW="1/1000", kW=1000),
}  # fmt: skip
SI = {next(iter(units)): dimension for dimension, units in DIMENSIONS.items()}
COMPOSITE = [symbol for symbol in SI if not symbol.isalpha()]  # replaced as one symbol if chosen
SYMBOL = re.compile(r"([A-Za-z]+\d*)(?:\^(\d+))?")
HEADING_UNIT = re.compile(r"(1|{0}( {0})*)(/{0}( {0})*)*".format(r"[A-Za-z]+(\^\d+)?"))


def known_units() -> str:
    """Return all units by dimension as text."""
    return "; ".join(f"{dimension}: {', '.join(units)}" for dimension, units in DIMENSIONS.items())


@dataclass(frozen=True)
class Units:
    """Chosen units by dimension; those left out are SI units.

    Attributes:
        chosen: a unit of `DIMENSIONS` by dimension.
    """

    chosen: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def parse(cls, names: Collection[str]) -> "Units":
        """Return units from their names, which determine the dimensions: ``["mm", "deg"]``.

        Raises:
            UnknownNameError: lists the units.
            InputError: for two units of one dimension.
        """
        out: dict[str, str] = {}
        for name in names:
            dimensions = [dimension for dimension, units in DIMENSIONS.items() if name in units]
            if not dimensions:
                raise UnknownNameError("unit", name, [unit for units in DIMENSIONS.values() for unit in units])
            if dimensions[0] in out:
                raise InputError(f"{out[dimensions[0]]} and {name} are both units of {dimensions[0]}: give one of them")
            out[dimensions[0]] = name
        return cls(out)

    def factor(self, unit: str) -> Factor:
        """Return the SI value of the chosen unit for an SI unit, ``"kg m^2"``; 1 for a list, ``"m, rad"``."""
        out = ONE
        for symbol, power in self._parts(unit):
            if symbol in SI and SI[symbol] in self.chosen:
                out = out.times(DIMENSIONS[SI[symbol]][self.chosen[SI[symbol]]].power(power))
        return out

    def name(self, unit: str) -> str:
        """Return the name of the chosen unit for an SI unit."""
        powers = [(self.chosen.get(SI[x], x) if x in SI else x, power) for x, power in self._parts(unit)]
        return _unit_text(powers) if powers else unit

    def displayed(self, x: Any, unit: str) -> Any:
        """Convert a value in SI, a number or an array, to these units."""
        return self.factor(unit).power(-1).apply(x)

    def _parts(self, unit: str) -> Iterator[tuple[str, int]]:
        """Yield the symbols of a unit and their powers; none for a unit without symbols, or a list of units."""
        if "," in unit:
            return
        composite = [x for x in COMPOSITE if SI[x] in self.chosen]
        pattern = re.compile("|".join([*(rf"(?<!/){re.escape(x)}(?![\w^])" for x in composite), "/", SYMBOL.pattern]))
        sign = 1
        for match in pattern.finditer(unit):
            if match[0] == "/":
                sign = -1
            else:
                yield (match[0], sign) if match[0] in composite else (match[1], sign * int(match[2] or 1))


def _unit_text(powers: Iterable[tuple[str, int]]) -> str:
    """Return a unit as text, from its symbols with their powers."""
    numerator: list[str] = []
    denominator: list[str] = []
    for symbol, power in powers:
        (numerator if power > 0 else denominator).append(symbol + (f"^{abs(power)}" if abs(power) != 1 else ""))
    return "/".join([" ".join(numerator) or "1", *denominator])


def si_value(unit: str) -> Factor | None:
    """Return the SI value of a unit in a heading of results, ``"N mm/deg"``; None for any other text."""
    if not HEADING_UNIT.fullmatch(unit):
        return None
    out, factors = ONE, {name: factor for units in DIMENSIONS.values() for name, factor in units.items()}
    for symbol, power in SI_UNITS._parts(unit):
        if symbol not in factors:
            return None
        out = out.times(factors[symbol].power(power))
    return out


def substituted(unit: str, symbols: Mapping[str, str]) -> str:
    """Replace the symbols of a unit by their units; return "" if one is left that is not a unit.

    >>> substituted("e s/q", {"e": "N m", "q": "rad"})
    'N m s/rad'
    """
    powers = _powers(unit, symbols)
    return "" if not powers or any(symbol in KEY_SYMBOLS for symbol in powers) else _unit_text(powers.items())


def _powers(unit: str, symbols: Mapping[str, str]) -> dict[str, int]:
    """Return the nonzero powers of a unit after its symbols are replaced by their units."""
    powers: dict[str, int] = {}
    for symbol, power in SI_UNITS._parts(unit):
        inner = _powers(symbols[symbol], symbols) if symbol in symbols else {symbol: 1}
        for name, k in inner.items():
            powers[name] = powers.get(name, 0) + power * k
    return {name: k for name, k in powers.items() if k}


def common_unit(units: Iterable[str]) -> str:
    """Return the common unit of compared numbers; if they differ, a list, ``"m, rad"``, which is shown in SI."""
    return ", ".join(dict.fromkeys(unit for text in units for unit in text.split(", ")))


def require_kind(unit: str, known: str, where: str) -> None:
    """Reject a unit whose dimension differs from that of a known SI unit, ``"m"`` for ``"rad"``.

    Raises:
        InputError: begins with ``where``, and lists units of the dimension.
    """
    if _powers(unit, BASE) != _powers(known, BASE):
        raise InputError(f"{where} is in {unit!r}, valid: {', '.join(DIMENSIONS.get(SI.get(known, ''), [known]))}")


BASE = {name: si for si, dimension in SI.items() for name in DIMENSIONS[dimension] if name != si and name.isalpha()}
BASE |= {"N": "kg m/s^2", "J": "kg m^2/s^2", "W": "kg m^2/s^3"}
KEY_SYMBOLS = ("q", "q1", "q2", "e", "r", "x", "y")  # symbols of joints and functions, see `mbdae.mechanism.key_units`
SI_UNITS = Units()
LISTED_TIMES = 5  # largest number of times in a line of text
_shown: ContextVar[Units] = ContextVar("shown", default=SI_UNITS)


def displayed_units() -> Units:
    """Return the units in which results are shown."""
    return _shown.get()


def displayed(x: Any, unit: str) -> tuple[Any, str]:
    """Return a value in SI, a number or an array, in the units in which results are shown, and the name of its unit."""
    units = _shown.get()
    return (units.displayed(x, unit), units.name(unit)) if units.chosen else (x, unit)


def unit_name(unit: str) -> str:
    """Return the name of the unit in which values with an SI unit are shown."""
    return _shown.get().name(unit) if _shown.get().chosen else unit


def quantity(x: float, unit: str, digits: str = ".6g") -> str:
    """Return a value in SI as text with its unit, if it has one, in the units in which results are shown."""
    value, name = displayed(float(x), unit)
    return f"{value:{digits}} {'' if name == '1' else name}".rstrip()


def elapsed(seconds: float) -> str:
    """Return a measured time in s as text of three digits, or to the unit if longer, in the unit of shown times."""
    x = float(displayed(seconds, "s")[0])
    return f"{x:.3g}" if x < 999.5 else f"{x:.0f}"  # from 999.5 on .3g is 1e+03


def time_span(t: Any, digits: str) -> str:
    """Return the first and last of times in s as text, in the unit in which times are shown."""
    return f"{displayed(float(t[0]), 's')[0]:{digits}} to {quantity(t[-1], 's', digits)}"


def listed_times(times: Any) -> str:
    """Return the first few of times in s as text, and their number, in the unit in which times are shown."""
    first = ", ".join(f"{displayed(float(t), 's')[0]:.9g}" for t in times[:LISTED_TIMES])
    more = ", ..." if len(times) > LISTED_TIMES else ""
    return f"t = {first}{more} {unit_name('s')} ({len(times)})" if len(times) else "never"


@contextmanager
def display_units(*names: str) -> Iterator[None]:
    """Show results in these units: text and tables, columns of pandas, xarray and .csv, axes of figures.

        with mbdae.display_units("mm", "deg"):
            print(study)
            sol.plot(path="run.svg")

    Arrays, ``to_dict``, .json and .npz stay in SI units, with angles in rad. Units of products follow: with mm a torque
    is shown in N mm and an inertia in kg mm^2, unless ``"N m"`` is also given.

    Args:
        names: one or several units, separated by commas: lengths m, mm, cm, in, ...; angles rad, deg, rev; masses
            kg, g, t, lb; times s, ms, min; forces N, kN, lbf; torques N m, N mm; angular velocities rpm; pressures MPa;
            energies J, kJ; powers W, kW.

    Raises:
        UnknownNameError: for an unknown unit; lists the units.
        InputError: for two units of one dimension.
    """
    given = [x.strip() for name in names for x in name.split(",") if x.strip()]
    token = _shown.set(Units.parse(given))
    try:
        yield
    finally:
        _shown.reset(token)
