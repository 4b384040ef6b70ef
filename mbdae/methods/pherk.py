"""Partitioned half-explicit Runge-Kutta methods (PHERK), which carry (y, z); the first stage is explicit.

A is a classical explicit method, extended by an extra stage at y_1; Ahat defines the points that satisfy the
constraint. Sources: A. Murua, Partitioned half-explicit Runge-Kutta methods for differential-algebraic
systems of index 2, Computing 59 (1997); E. Hairer and G. Wanner, Solving Ordinary Differential Equations II,
section VII.6.
"""

from .exact_numbers import row, rows
from .tableau import Tableau

pherk3 = Tableau(
    name="pherk3",
    title="PHERK on the method of Kutta",
    reference="derived for mbdae from the order conditions: C(3) on Ahat, chat_4 = 1/2",
    A=rows("""
        0
        1/2
        -1   2
        1/6  2/3  1/6
    """),
    Ahat=rows("""
        0
        3/16  9/16
        1/6   2/3   1/6
        5/24  1/3   -7/24  1/4
    """),
    b=row("1/6 2/3 1/6"),
    order=3,
    order_own=3,
    # Order 2 leaves b + x (1, -2, 1, 0) + y (1, -2, 0, 1); x = -1/6, y = 0 is the midpoint rule, for which no
    # condition of order 3 holds accidentally.
    b_embedded=row("0 1 0"),
    order_embedded=2,
)

pherk4 = Tableau(
    name="pherk4",
    title="PHERK on the 3/8 rule",
    reference="after Murua 1997 (attribution not confirmed)",
    A=rows("""
        0
        1/3
        -1/3  1
        1     -1   1
        1/8   3/8  3/8  1/8
    """),
    Ahat=rows("""
        0
        1/8       3/8
        161/1024  147/512    441/1024
        1/8       3/8        3/8       1/8
        693/5000  1701/5000  243/625   81/1250  -81/2500
    """),
    b=row("1/8 3/8 3/8 1/8"),
    order=4,
    order_own=4,
    # Order 3 leaves b + theta (-1/4, 3/4, -3/4, -3/4, 1); theta = 1/6 gives weights >= 0.
    b_embedded=row("1/12 1/2 1/4 0 1/6"),
    order_embedded=3,
)

pherk5 = Tableau(
    name="pherk5",
    title="PHEM56: PHERK on the method of Dormand and Prince",
    reference="Murua 1997, Fortran code PHEM56",
    A=rows("""
        0
        1/5
        3/40        9/40
        44/45       -56/15       32/9
        19372/6561  -25360/2187  64448/6561  -212/729
        9017/3168   -355/33      46732/5247  49/176    -5103/18656
        35/384      0            500/1113    125/192   -2187/6784   11/84
    """),
    Ahat=rows("""
        0
        3/40         9/40
        21/256       45/256    15/128
        19235/98784  -225/392  6235/6174   2755/32928
        -293/1152    85/48     -2275/1908  35/32       -2835/6784
        35/384       0         500/1113    125/192     -2187/6784  11/84
        10752038939/66307507200  -19259/50160  19581770468/24023520675  9941999/650073600 \
          180060831/4820710400  -11331659/439538400  1/76
    """),
    b=row("35/384 0 500/1113 125/192 -2187/6784 11/84"),
    order=5,
    order_own=4,
    # Order 4 only after projection: without it, only b itself satisfies the conditions of order 4.
    b_embedded=row("5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40"),
    order_embedded=4,
    project_embedded=True,
)
