"""Order and stability of generalized-alpha methods, from their exact coefficients.

On y'' = f, a approximates y'' at t + offset h, offset = alpha_m - alpha_f, and has order 2 with
gamma = 1/2 - offset; y and y' then have order 2. The method is unconditionally stable for linear oscillations if
alpha_m <= alpha_f <= 1/2 and beta >= 1/4 - offset/2 (Chung, Hulbert, J. Appl. Mech. 60 (1993)).
"""

from dataclasses import asdict, dataclass
from fractions import Fraction

from ...data_types import JsonObject
from ..alpha import GeneralizedAlpha


@dataclass(frozen=True)
class AlphaReport:
    """Result of the order and stability conditions of a generalized-alpha method.

    Attributes:
        name: name of the method.
        claimed: the claimed order.
        order: the order of q, v and lam, 1 or 2.
        stable: whether it is unconditionally stable.
        numbers: alpha_m, alpha_f, gamma, beta as text.
    """

    name: str
    claimed: int
    order: int
    stable: bool
    numbers: tuple[str, str, str, str]

    @property
    def holds(self) -> bool:
        """Whether the claim is reached and the method is stable."""
        return self.stable and self.order >= self.claimed

    def __str__(self) -> str:
        return (
            f"{self.name}: its claims {'hold' if self.holds else 'DO NOT HOLD'}\n"
            f"  q, v, own z         claimed {self.claimed}, found {self.order}\n"
            f"  oscillations        {'stable' if self.stable else 'NOT STABLE'} for all steps\n"
            f"  alpha_m, alpha_f, gamma, beta = {', '.join(self.numbers)}"
        )

    def to_dict(self) -> JsonObject:
        """Return the report as JSON data."""
        return asdict(self) | {"holds": self.holds}


def check_alpha(method: GeneralizedAlpha) -> AlphaReport:
    """Check the order condition and the conditions of stability."""
    am, af, gamma, beta = method.alpha_m, method.alpha_f, method.gamma, method.beta
    order = 2 if gamma == Fraction(1, 2) - (am - af) else 1
    stable = am <= af <= Fraction(1, 2) and beta >= Fraction(1, 4) + (af - am) / 2
    return AlphaReport(method.name, method.order, order, stable, (str(am), str(af), str(gamma), str(beta)))
