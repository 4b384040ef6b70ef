"""The IFToMM library's benchmark problems A01 to A05, and what can be known of their solutions.

A01 has a solution in elliptic functions; in A02 all cranks must stay parallel through singular positions; A03 is
Andrews' mechanism, where the crank's torque must make up the energy, and a reference of quadruple precision is known;
A04 has more closures than freedoms and keeps its energy; A05 is stiff, its slider is compared with another program's.

Run: python examples/benchmarks/iftomm.py [A01 A02 ...]
"""

import sys
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np
from scipy.special import ellipj, ellipk

from mbdae import drift, load, solve

OMEGA, M = np.sqrt(9.81), 0.5  # of the pendulum; m = k^2, k = sin 45 degrees
END = {"beta": 15.8107711951537072507, "Theta": -15.7563710584118396601, "gamma": 0.0408222401196458005}
SLIDER = 0.6196229  # m at 10 s, from equations in two coordinates


def a01() -> dict[str, float]:
    """Pendulum from horizontal rest: largest error of the position in m over 10 s."""
    sol = solve(load("pendulum"), (0, 10), method="pherk6", rtol=1e-12)
    phi = -2 * np.arcsin(np.sqrt(M) * ellipj(ellipk(M) - OMEGA * sol.t, M)[0])
    exact = np.stack([np.sin(phi), 0 * phi, -np.cos(phi)], axis=1)
    return {"error": float(np.abs(sol.q - exact).max()), "|g|": drift(sol).g_max}


def a02(N: int = 40) -> dict[str, float]:
    """N four-bars for 10 s, ten times through the singular position: cranks that differ in rad, energy."""
    sol = solve(load("n_four_bar", N=N), (0, 10), method="pherk5", rtol=1e-8)
    cranks = [i for i, name in enumerate(sol.mechanism.joint_names) if name.startswith("crank")]
    spread = float(np.ptp(sol.q[:, cranks], axis=1).max())
    found = drift(sol)
    passed = len(sol.singular)
    return {"cranks differ by": spread, "energy, relative": found.energy_relative, "singular positions": passed}


def a03() -> dict[str, float]:
    """Andrews' mechanism: error of three angles at 0.03 s in rad, energy to 0.05 s."""
    mech = load("andrews_squeezer")
    sol = solve(mech, (0, 0.03), method="pherk5", rtol=1e-10)
    at = [mech.joint_names.index(name) for name in END]
    error = float(np.abs(sol.q[-1][at] - list(END.values())).max())
    energy = drift(solve(mech, (0, 0.05), method="pherk5", rtol=1e-10)).energy_relative
    return {"error": error, "energy, relative": energy}


def a04() -> dict[str, float]:
    """Bricard's mechanism for 10 s: energy, and |g| over all rows, also those that depend on others."""
    found = drift(solve(load("bricard"), (0, 10), method="pherk5", rtol=1e-12))
    return {"|g|": found.g_max, "energy, relative": found.energy_relative}


def a05() -> dict[str, float]:
    """Stiff flyball governor for 10 s: the slider's height in m, and its error."""
    sol = solve(load("flyball_governor"), (0, 10), method="radau5", rtol=1e-8)
    s = float(sol.q[-1][sol.mechanism.joint_names.index("slider")])
    return {"s": s, "error": abs(s - SLIDER)}


PROBLEMS: dict[str, Callable[[], dict[str, float]]] = {"A01": a01, "A02": a02, "A03": a03, "A04": a04, "A05": a05}


def main(names: Sequence[str] = tuple(PROBLEMS)) -> dict[str, dict[str, float]]:
    """Print a row for each problem, and return what was measured."""
    out = {}
    for name in names:
        started = perf_counter()
        out[name] = PROBLEMS[name]()
        values = ", ".join(f"{what} {value:.3g}" for what, value in out[name].items())
        print(f"{name}  {values}  ({perf_counter() - started:.1f} s)")
    return out


if __name__ == "__main__":
    main(sys.argv[1:] or tuple(PROBLEMS))
