"""First steps: load a mechanism, choose its start, run it, check the run, save it, replay it.

Run: python examples/first_steps.py
"""

from pathlib import Path

import mbdae


def main(folder: str | Path = ".", end: float = 5.0) -> mbdae.Solution:
    """Write run.npz and run.html into ``folder`` and return the solution."""
    mech = mbdae.load("slider_crank")
    print(mbdae.info(mech))
    q, v = mech.assemble(q={"crank": 0.3}, v={"crank": 6.0})  # the loop gives the other coordinates
    sol = mbdae.solve(mech, (0, end), q, v, rtol=1e-8)
    print(f"{sol.status}: {sol.stats['steps']} steps, {sol.stats['solves']} linear solves")
    print(mbdae.drift(sol))
    force = sol.reaction("wrist pin").force_world  # (n, 3) in N, along the world's axes
    print(f"the wrist pin carries up to {max(sum(f * f) ** 0.5 for f in force):.4g} N")
    sol.save(Path(folder) / "run.npz")
    mbdae.animate(sol, Path(folder) / "run.html")
    return sol


if __name__ == "__main__":
    main()
