"""A custom method: a tableau as exact text, its order proven and measured.

The half-explicit method on Ralston's three stages: Ahat is A shifted and closed by b. The conditions of trees with fat
vertices determine what remains of its order 3.

Run: python examples/custom_method.py
"""

import mbdae
from mbdae import Tableau
from mbdae.methods.order.conditions import check_conditions

ralston = Tableau(
    name="ralston3",
    title="method of Ralston (order 3) used as HERK",
    reference="Ralston 1962",
    A=((), ("1/2",), ("0", "3/4")),
    b=("2/9", "1/3", "4/9"),
    order=2,
    order_linear=2,
    order_own=1,
)


def main(model: str = "four_bar") -> object:
    """Print proof and measurement, and return the measurement."""
    print(check_conditions(ralston))
    study = mbdae.order(mbdae.load(model), [ralston])
    print(study)
    print(mbdae.drift(mbdae.solve(mbdae.load(model), (0, 1), method=ralston, step=1e-3)))
    return study


if __name__ == "__main__":
    main()
