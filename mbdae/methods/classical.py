"""Classical explicit tableaus as HERK methods, counterexamples whose order drops to 2.

A tableau designed without the constraint violates the order conditions of index 2. Kutta's method of order 3, the
classical method of order 4 and the 3/8 rule all have order 2 (3 when f is linear in z, as in mechanics). They
are provided for demonstration and comparison; their claimed orders are these.
"""

from .exact_numbers import row, rows
from .tableau import Tableau

kutta3 = Tableau(
    name="kutta3",
    title="method of Kutta (order 3) used as HERK: order reduction",
    reference="W. Kutta 1901; a demonstration",
    A=rows("""
        0
        1/2
        -1   2
    """),
    b=row("1/6 2/3 1/6"),
    order=2,
    order_linear=3,
    order_own=1,
    order_ode=3,
)

rk4 = Tableau(
    name="rk4",
    title="classical method (order 4) used as HERK: order reduction",
    reference="W. Kutta 1901; a demonstration",
    A=rows("""
        0
        1/2
        0    1/2
        0    0    1
    """),
    b=row("1/6 1/3 1/3 1/6"),
    order=2,
    order_linear=3,
    order_own=1,
    order_ode=4,
)

rule38 = Tableau(
    name="rule38",
    title="3/8 rule (order 4) used as HERK: order reduction",
    reference="W. Kutta 1901; a demonstration",
    A=rows("""
        0
        1/3
        -1/3  1
        1     -1  1
    """),
    b=row("1/8 3/8 3/8 1/8"),
    order=2,
    order_linear=3,
    order_own=1,
    order_ode=4,
)
