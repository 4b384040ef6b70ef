"""A partitioned half-explicit method of order 6 in seven stages, derived from the order conditions.

Number of stages. For y = (u, w), u' = phi(u), w' = z, 0 = w the method is its explicit base A acting on u, and
an explicit method of order 6 has at least seven stages. The conditions are those of
`mbdae.methods.order.conditions`.

The base A. It has b_2 = 0 and D(1), sum_i b_i a_ij = b_j (1 - c_j); rows 3 to 7 satisfy C(3), for which
row 3 needs c_2 = 2 c_3 / 3 and row 4 needs c_4 = c_3 / (2 - 10 c_3 + 15 c_3^2); c_7 = 1. The low
order of the second stage has no effect, because sum_i b_i c_i^k a_i2 = 0.

The constrained points Ahat. All rows satisfy Chat(3), sum_j ahat_ij c_j^(k-1) = chat_i^k / k for k = 1,
2, 3, which makes chat_2 = 3 c_2 / 2 = c_3. The error of Z_i then adds only O(h^3) to that of Y_i, and
the trees in which f is nonlinear in z are satisfied automatically. For a fat tree u = [t_1..]_z the last row, b,
gives b . psi(u) = prod (b . phi(t_k)): trees [u]_y need no further condition. Those in which psi(u) is multiplied by
c_i or followed by A contain b (1 - c) . psi(u), by D(1). With beta defined by

    sum_i beta_i ahat_ij = b_j (1 - c_j)  (j = 2..7)

it equals beta . prod (Ahat phi(t_k)), so that u = [tau..tau]_z requires sum_i beta_i chat_i^k = 1/(k + 1),
k = 2..5. A second transposed assumption covers the trees with c_i^2,

    sum_i beta_i chat_i ahat_ij = b_j (1 - c_j^2) / 2,    sum_i beta_i chat_i^2 ahat_i2 = 0,

and the remaining equations are linear in the remaining entries of Ahat.

The extra stage 8, at (y_1, z_1), has Chat(3) and the z-conditions of order 4, and w_81 = 0: the error
of z_0 vanishes after a step.

Choice of the parameters. chat_4 = c_4, chat_6 = (1 + c_6) / 2, and c_3 = 2/9, c_5 = 7/10, c_6 = 4/5, chat_3 = 4/9,
chat_5 = 7/9, chat_8 = 3/5 give nodes in [0, 1], b >= 0 and coefficients below 1.3. chat is not monotone
(4/9, then 3/7).

Error estimate. The conditions of order 5 allow only b on the eight stages, so the embedded formula has
order 4, on all trees and without a projection. There is no companion of order 3: with one, Andrews'
mechanism costs a tenth more solves at equal error.
"""

from .exact_numbers import row, rows
from .tableau import Tableau

pherk6 = Tableau(
    name="pherk6",
    title="PHERK of order 6",
    reference="derived for mbdae from the order conditions (see the module)",
    A=rows("""
        0
        4/27
        1/18          1/6
        66/343        -729/1372   1053/1372
        35441/132000  -1701/8800  -8127/286000    280231/429000
        -12451/28875  243/275     25272/59125     -43316/78375   2704/5719
        112/219       -243/292    581553/2121964  562520/703209  -13200/59641  5775/12337
        73/1008       0           59049/203476    84035/462384   11000/51471   1375/8112   73/1008
    """),
    Ahat=rows("""
        0
        1/18        1/6
        2/9         -2/3       8/9
        -1011/5488  6561/5488  -2187/2744    3/14
        181/81648   13/48      2545/40248    80605/360126  302500/1389717
        56004309/580160000  -19683/236800  103467934467/301144480000  241544079/1188070000 \
          106219971/592488400  89878437/560268800
        73/1008     0          59049/203476  84035/462384  11000/51471     1375/8112  73/1008
        1639023/57890000  59049/330800  4229817651/30049045000  1265915931/6638742500  9857892/118240325 \
          -267597/13976300  -107967/2067500  25704/516875
    """),
    b=row("73/1008 0 59049/203476 84035/462384 11000/51471 1375/8112 73/1008"),
    order=6,
    order_own=5,
    b_embedded=row("199/2520 0 153819/581360 987497/4623840 10175/51471 1375/8112 73/1440 1/40"),
    order_embedded=4,
)
