"""Half-explicit methods with explicit stages: the constraint is imposed at the point of the next stage.

The first stage is explicit, and Ahat_i = A_{i+1} after it, so that G is evaluated at one point per stage. Source:
M. Arnold, Half-explicit Runge-Kutta methods with explicit stages for differential-algebraic systems of index 2, BIT 38
(1998).
"""

from .exact_numbers import row, rows
from .tableau import Tableau

hedop5 = Tableau(
    name="hedop5",
    title="HEDOP5: explicit stages on the method of Dormand and Prince",
    reference="Arnold 1998, HEDOP5",
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
        3/40        9/40
        44/45       -56/15       32/9
        19372/6561  -25360/2187  64448/6561  -212/729
        9017/3168   -355/33      46732/5247  49/176    -5103/18656
        35/384      0            500/1113    125/192   -2187/6784   11/84
        -18611506045861/19738176307200  59332529/14479296  -2509441598627/893904224850 \
          2763523204159/3289696051200  -41262869588913/116235927142400  46310205821/287848404480 \
          -3280/75413
    """),
    b=row("35/384 0 500/1113 125/192 -2187/6784 11/84"),
    order=5,
    order_own=4,
    # Order 4 only after projection: without it, only b itself satisfies the conditions of order 4.
    b_embedded=row("5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40"),
    order_embedded=4,
    project_embedded=True,
)

arnold4 = Tableau(
    name="arnold4",
    title="explicit stages, order 4",
    reference="order 4 with explicit stages, as used by Hante on Lie groups",
    A=rows("""
        0
        1
        3/8   1/8
        -1/2  -1/2  2
        1/6   0     2/3  1/6
    """),
    Ahat=rows("""
        0
        3/8              1/8
        -1/2             -1/2  2
        1/6              0     2/3               1/6
        1/6-sqrt(3)/108  0     1/3-4*sqrt(3)/27  -7*sqrt(3)/108  sqrt(3)/18
    """),
    b=row("1/6 0 2/3 1/6"),
    order=4,
    order_own=3,
    # No embedded formula: order 3 leaves b + theta (0, 0, 0, -1, 1), which does not detect errors of f(t): c_4 = c_5.
)
