"""Units of FMI: exponents of SI base units."""

import re

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
DERIVED: dict[str, dict[str, int]] = {
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "1": {},
}


def base_exponents(unit: str) -> dict[str, int] | None:
    """Return the exponents of base units of a product like ``N m s/rad^2``; None for an unknown unit.

    Example:
        >>> base_exponents("N m/rad")
        {'kg': 1, 'm': 2, 's': -2, 'rad': -1}
    """
    out: dict[str, int] = {}
    for k, product in enumerate(unit.split("/")):
        for factor in re.split(r"[ *]+", product.strip()):
            match = re.fullmatch(r"([A-Za-z1]+)(?:\^?(-?\d+))?", factor)
            name = match[1] if match else ""
            if not match or name not in (*BASE, *DERIVED):
                return None
            sign = int(match[2] or 1) * (-1 if k else 1)
            for base, power in DERIVED.get(name, {name: 1}).items():
                out[base] = out.get(base, 0) + sign * power
    return {base: power for base, power in out.items() if power}
