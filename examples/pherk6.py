"""pherk6: a half-explicit method of order 6 in seven stages, derived and demonstrated.

Derivation. A PHERK method has two matrices: A, an explicit Runge-Kutta method for the points Y_i, and Ahat for the
points Yhat_i that are put on the constraint. On u' = phi(u), w' = z, 0 = w only A matters, so order 6 needs the seven
stages of an explicit method of order 6. Index 2 adds the trees with fat vertices, one for each dependence of z on y:
22057 trees of order 6 in all. They reduce to a handful of equations by simplifying assumptions:

* C(3) on the rows 3 to 7 of A, b_2 = 0 and D(1): the base method, as for ordinary equations;
* Chat(3) on every row of Ahat: the error of Z_i is O(h^3), so trees in which f is nonlinear in z follow;
* with beta Ahat = b (1 - c) on the columns 2 to 7: sum_i beta_i chat_i^k = 1/(k + 1), k = 2..5, satisfies the trees in
  which a fat vertex is below one more meagre one, and (beta chat) Ahat = b (1 - c^2)/2 those below a product.

The remaining conditions are linear in the entries of Ahat. The free nodes are chosen rational, in [0, 1], with all
weights positive. The module mbdae.methods.pherk6 has the coefficients and each equation.

This script proves the orders on all trees in exact arithmetic, measures them on the pendulum, and compares the work
with pherk5 on Andrews' mechanism.

Run: python examples/pherk6.py
"""

import numpy as np

from mbdae import METHODS, load, order, solve
from mbdae.methods.order.conditions import check_conditions

ANGLE, REFERENCE = "beta", 15.8107711951537072507  # of Andrews' crank at t = 0.03 s, from quadruple precision


def main(rtol: tuple[float, ...] = (1e-6, 1e-7, 1e-8, 1e-9)) -> dict[str, object]:
    """Print the proof, the observed orders and the work; return them."""
    report = check_conditions(METHODS["pherk6"])
    print(report)
    study = order(load("pendulum"), ["pherk6"])
    print(f"\n{study}\n")
    mech, work = load("andrews_squeezer"), {}
    index = mech.joint_names.index(ANGLE)
    print(f"{'':8s}" + "".join(f"  rtol {r:.0e}: error, solves" for r in rtol))
    for method in ("pherk5", "pherk6"):
        rows = []
        for r in rtol:
            sol = solve(mech, (0, 0.03), method=method, rtol=r, atol=r)
            rows.append((abs(sol.q[-1, index] - REFERENCE), sol.stats["solves"]))
        work[method] = np.array(rows)
        print(f"{method:8s}" + "".join(f"  {e:16.1e}, {n:6d}" for e, n in rows))
    return {"conditions": report, "study": study, "work": work}


if __name__ == "__main__":
    main()
