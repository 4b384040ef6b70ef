"""Implicit Runge-Kutta methods besides Radau IIA, some of which violate the assumptions of index-2 theory.

Source of the coefficients: Hairer, Wanner, Solving Ordinary Differential Equations II, tables IV.5.2 to IV.5.12. The
orders for index 2 are those of section VII.4 there (Hairer, Lubich, Roche 1989, chapter 4). The trapezoidal rule and
the other Lobatto IIIA methods are missing, since their A is singular.
"""

from .exact_numbers import row, rows
from .implicit_tableau import ImplicitTableau

SOURCE = "Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.5"

midpoint = ImplicitTableau(
    name="midpoint",
    title="implicit midpoint rule: order 2, own z does not converge",
    reference=SOURCE,
    A=rows("1/2"),
    b=row("1"),
    order=2,
    order_own=0,
)

gauss2 = ImplicitTableau(
    name="gauss2",
    title="Gauss, 2 stages (order 4 for ODEs): own z does not converge",
    reference=SOURCE,
    A=rows("""
        1/4              1/4-sqrt(3)/6
        1/4+sqrt(3)/6    1/4
    """),
    b=row("1/2 1/2"),
    order=2,
    order_own=0,
)

gauss3 = ImplicitTableau(
    name="gauss3",
    title="Gauss, 3 stages (order 6 for ODEs)",
    reference=SOURCE,
    A=rows("""
        5/36                2/9-sqrt(15)/15     5/36-sqrt(15)/30
        5/36+sqrt(15)/24    2/9                 5/36-sqrt(15)/24
        5/36+sqrt(15)/30    2/9+sqrt(15)/15     5/36
    """),
    b=row("5/18 4/9 5/18"),
    order=4,
    order_own=2,
)

radau_ia2 = ImplicitTableau(
    name="radau_ia2",
    title="Radau IA, 2 stages (order 3 for ODEs)",
    reference=SOURCE,
    A=rows("""
        1/4   -1/4
        1/4   5/12
    """),
    b=row("1/4 3/4"),
    order=2,
    order_own=1,
)

lobatto_iiic2 = ImplicitTableau(
    name="lobatto_iiic2",
    title="Lobatto IIIC, 2 stages",
    reference=SOURCE,
    A=rows("""
        1/2   -1/2
        1/2   1/2
    """),
    b=row("1/2 1/2"),
    order=2,
    order_own=1,
)

lobatto_iiic3 = ImplicitTableau(
    name="lobatto_iiic3",
    title="Lobatto IIIC, 3 stages",
    reference=SOURCE,
    A=rows("""
        1/6   -1/3   1/6
        1/6   5/12   -1/12
        1/6   2/3    1/6
    """),
    b=row("1/6 2/3 1/6"),
    order=4,
    order_own=2,
)

sdirk2 = ImplicitTableau(
    name="sdirk2",
    title="SDIRK, 2 stages with the diagonal 1 - 1/sqrt(2)",
    reference="R. Alexander, SIAM J. Numer. Anal. 14 (1977)",
    A=rows("""
        1-sqrt(2)/2   0
        sqrt(2)/2     1-sqrt(2)/2
    """),
    b=row("sqrt(2)/2 1-sqrt(2)/2"),
    order=2,
    order_own=1,
)
