"""Solves that herk5 and pherk5 need on Andrews' mechanism, compared with the Fortran codes HEM5 and PHEM56.

Compared at equal error of q at t = 0.03 s, against the quadruple-precision reference, by a straight line through
log(error) and log(solves), fitted to all runs. The Fortran rows were measured with their authors' codes and full
linear algebra.

Run: python examples/benchmarks/andrews.py
"""

import numpy as np

from mbdae import load, solve

FORTRAN = {  # error of q, solves
    "pherk5": [(3.2e-5, 607), (2.6e-7, 1273)],
    "herk5": [(2.2e-5, 768), (1.3e-7, 1840)],
}
REFERENCE = {  # of two codes in quadruple precision, agreeing to 1.2e-13
    "beta": 15.8107711951537072507,
    "Theta": -15.7563710584118396601,
    "gamma": 0.0408222401196458005,
    "Phi": -0.5347301163420796029,
    "delta": 0.5244099658799540702,
    "Omega": 0.5347301163420796034,
    "epsilon": 1.0480807410419378694,
}
RTOL = np.logspace(-4, -9, 11)


def work(method: str, rtol: np.ndarray = RTOL) -> np.ndarray:
    """Error of q and solves for each tolerance, (n, 2)."""
    mech = load("andrews_squeezer")
    reference = np.array([REFERENCE[name] for name in mech.joint_names])
    rows = []
    for tolerance in rtol:
        sol = solve(mech, (0, 0.03), method=method, rtol=tolerance, atol=tolerance)
        rows.append((np.abs(sol.q[-1] - reference).max(), sol.stats["solves"]))
    return np.array(rows)


def solves_at(points: np.ndarray, error: float) -> float:
    """Solves at an error, from a straight line through log(error), log(solves)."""
    slope, offset = np.polyfit(np.log(points[:, 0]), np.log(points[:, 1]), 1)
    return float(np.exp(offset + slope * np.log(error)))


def main() -> list[tuple[str, float, int, float]]:
    """Print the table and return method, error, Fortran solves and the ratio of mbdae's to theirs."""
    out = []
    print(f"{'method':8s} {'error of q':>10s} {'Fortran':>8s} {'mbdae':>7s} {'ratio':>6s}")
    for method, rows in FORTRAN.items():
        points = work(method)
        for error, solves in rows:
            ours = solves_at(points, error)
            out.append((method, error, solves, ours / solves))
            print(f"{method:8s} {error:10.1e} {solves:8d} {ours:7.0f} {ours / solves:6.2f}")
    return out


if __name__ == "__main__":
    main()
