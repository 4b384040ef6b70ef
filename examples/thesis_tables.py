"""Convergence tables on a problem that is nonlinear in z: order reduction, and its cure.

    y1' = y1 y2^2 z^2,  y2' = y1^2 y2^2 - 3 y2^2 z,  0 = y1^2 y2 - 1,   exact y = (e^t, e^-2t), z = e^2t

Classical explicit tableaus used half-explicitly (kutta3, rk4, rule38) drop to order 2, because their stages do not
satisfy the conditions of the trees with fat vertices. HERK methods satisfy them with more stages; PHERK methods keep
the classical tableau and add a second matrix for its stages: the 3/8 rule reaches order 4 with the same four solves.

The last table names the command that shows a statement of the thesis on half-explicit and implicit methods for index
2, whose chapter 2 is on implicit methods, and chapter 3 on half-explicit ones.

Run: python examples/thesis_tables.py
"""

import numpy as np

from mbdae import METHODS, solve
from mbdae.textbook.problems import hessenberg_a

FAMILIES = {
    "Radau IIA": ("radau1", "radau3", "radau5"),
    "HERK": ("herk1", "herk2", "herk3", "herk4", "herk5"),
    "PHERK": ("pherk3", "pherk4", "pherk5", "pherk6", "hedop5", "arnold4"),
    "classical, used as HERK": ("kutta3", "rk4", "rule38"),
}
STEPS = (20, 40, 80, 160, 320)
COMMANDS = (  # statement, command
    ("2: an index-2 problem in Hessenberg form", "mbdae info hessenberg_a"),
    ("2: coefficients, B(p), C(q), D(r) and R(infinity)", "mbdae methods radau3 lobatto_iiic2 gauss2"),
    ("Theorems 2.2.2, 2.2.3: orders of y and z", "mbdae order hessenberg_a -m radau3"),
    ("their assumption |R(infinity)| < 1", "mbdae order hessenberg_a -m midpoint"),
    ("figure 2.2: errors over time", "python examples/errors_over_time.py"),
    ("3: stages off by delta change z by delta/h", "python examples/errors_over_time.py"),
    ("3: order conditions of half-explicit methods", "mbdae methods --check herk3 pherk4"),
    ("3: orders of half-explicit methods", "mbdae order hessenberg_a -m pherk3"),
    ("3: order reduction of classical methods", "mbdae order hessenberg_a -m kutta3"),
    ("mixed index 1 and 2", "mbdae order mixed_index -m herk3"),
    ("drift of positions, and projection", "mbdae drift pendulum -m herk3 --step 0.01 -t 1"),
    ("another problem of index 2", "mbdae compare driven_circuit -m pherk5,radau5 --rtol 1e-4,1e-6"),
    ("cost of each family at equal error", "python examples/textbook_costs.py"),
)


def errors(method: str, steps: tuple[int, ...] = STEPS) -> np.ndarray:
    """Largest errors of y and of the method's z over the run, one row for each number of steps."""
    problem, rows = hessenberg_a(), []
    for n in steps:
        sol = solve(problem, (0, 1), method=method, step=1 / n)
        if not sol.success:
            rows.append((np.nan, np.nan))
            continue
        exact = [problem.exact(t) for t in sol.t]
        y, z = np.array([e[0] for e in exact]), np.array([e[1] for e in exact])
        rows.append((np.abs(sol.y - y).max(), np.abs(sol.z_own - z).max()))
    return np.array(rows)


def main(steps: tuple[int, ...] = STEPS) -> dict[str, np.ndarray]:
    """Print the tables and return the errors by method."""
    result, refinements = {}, np.divide(steps[1:], steps[:-1])[:, None]
    print(f"{'':10s} claimed   error of y and its order" + " " * max(1, 17 * len(steps) - 21) + "own z")
    print(f"{'steps':10s} y  own z " + "".join(f"{n:>12d}     " for n in steps) + f"{steps[-1]:>12d}")
    for family, names in FAMILIES.items():
        print(family)
        for name in names:
            e = result[name] = errors(name, steps)
            with np.errstate(divide="ignore", invalid="ignore"):
                orders = np.log(e[:-1] / e[1:]) / np.log(refinements)
            cells = [f"{e[0, 0]:12.2e}     "] + [
                f"{x:12.2e} {o:4.1f}" for x, o in zip(e[1:, 0], orders[:, 0], strict=True)
            ]
            m = METHODS[name]
            own = "".join(f" {x:4.1f}" for x in orders[-1:, 1])
            print(f"  {name:8s} {m.order}  {m.order_own}     {''.join(cells)}{e[-1, 1]:12.2e}{own}")
    print(f"\n{'statement of the thesis':52s}command")
    for statement, command in COMMANDS:
        print(f"{statement:52s}{command}")
    return result


if __name__ == "__main__":
    main()
