"""Half-explicit Runge-Kutta methods (HERK), which carry only y from step to step.

Row i of Ahat is row i + 1 of A, the last one is b, so only A and b are listed. Sources:

* E. Hairer, Ch. Lubich and M. Roche, The Numerical Solution of Differential-Algebraic Systems by Runge-Kutta
  Methods, Springer 1989;
* V. Brasey and E. Hairer, Half-explicit Runge-Kutta methods for differential-algebraic systems of index 2,
  SIAM J. Numer. Anal. 30 (1993);
* V. Brasey, HEM5 (a Fortran code).
"""

from .exact_numbers import row, rows
from .tableau import Tableau

herk1 = Tableau(
    name="herk1",
    title="half-explicit Euler",
    reference="Hairer, Lubich and Roche 1989",
    A=rows("""
        0
    """),
    b=row("1"),
    order=1,
    order_own=1,
)

herk2 = Tableau(
    name="herk2",
    title="half-explicit midpoint rule",
    reference="Hairer, Lubich and Roche 1989",
    A=rows("""
        0
        1/2
    """),
    b=row("0 1"),
    order=2,
    order_own=1,
    # half-explicit Euler: sum b = 1, and F_1 alone cannot reach order 2
    b_embedded=row("1 0"),
    order_embedded=1,
)

herk3 = Tableau(
    name="herk3",
    title="three stages of Brasey and Hairer",
    reference="Brasey and Hairer 1993, table 2",
    A=rows("""
        0
        1/3
        -1   2
    """),
    b=row("0 3/4 1/4"),
    order=3,
    order_own=2,
    # Without projection, only b itself satisfies the 4 conditions of order <= 2. Projection removes the conditions of
    # the two trees [u]_y; sum b = 1 and sum b c = 1/2 leave b + theta (2, -3, 1): 1/4 gives the trapezoidal rule.
    b_embedded=row("1/2 0 1/2"),
    order_embedded=2,
    project_embedded=True,
)

herk4 = Tableau(
    name="herk4",
    title="HEM4: five stages of Brasey and Hairer",
    reference="Brasey and Hairer 1993, table 5",
    A=rows("""
        0
        3/10
        1/30+sqrt(6)/30         11/30-2*sqrt(6)/15
        -79/150-31*sqrt(6)/150  -2*sqrt(6)/15-1/30  24/25+11*sqrt(6)/25
        5*sqrt(6)/6+7/3         -4/3+7*sqrt(6)/6    -7*sqrt(6)/4-9/4     9/4-sqrt(6)/4
    """),
    b=row("0 0 4/9-sqrt(6)/36 sqrt(6)/36+4/9 1/9"),
    order=4,
    order_own=2,
    # No embedded formula: only b itself satisfies the conditions of order 3, projected or not.
)

_HEM5_Y8 = row("""
    0  0  0  3.6244772487538767825896307970248  -0.46177241891829482085695512030101 \
      -3.1980246281643326265127741762017  1.0353197983287506647800984994780
""")

herk5 = Tableau(
    name="herk5",
    title="HEM5: eight stages of Brasey",
    reference="Brasey, Fortran code HEM5; its 16 digits refined by the order conditions",
    A=rows("""
        0
        1/10
        3/80  9/80
        0.32221692362160629241536571337451  -1.1888833229876134044243572471327 \
          1.2281451340233703632134827774659
        -0.035011238981299957588085655884761  0.37254206010861811321454383365881 \
          -0.27210535355820445328055274399069  0.019930375785750759924972577050814
        -0.55765470550419210506226470721407  1.3673072896458913627733153617889 \
          -1.7322363604607100804841828799389  0.45877720074675299432673575809639 \
          0.96380657557225782844639646726769
        0.086545171935642818485064218939378  -0.088100828479454031447542694371929 \
          0.19812755473290756013022818961404  -0.46454226793310962187211484516546 \
          0.16151700911099957075910342508394  0.90645336063301370394526170590003
    """)
    + (_HEM5_Y8,),
    b=row("""
        0  0  0  0.24677606676367868733765457470898  0.21065940874897317414196113738504 \
          0.17692181491250153939182309203502  0.30644464441479326972288359087777 \
          0.059198065160053329405677604993187
    """),
    order=5,
    order_own=3,
    # Y_8, which satisfies the constraint like y_1: order 3
    b_embedded=_HEM5_Y8,
    # order 2 from stages 7 and 8: together an error estimate of size h^5 (see Tableau.error_power)
    b_companion=row("0 0 0 0 0 0 5/2 -3/2"),
    order_embedded=3,
    rounded=True,
)
