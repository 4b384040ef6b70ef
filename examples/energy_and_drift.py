"""Invariants of a formulation: |g| and energy over time, for one mechanism and one method.

Without friction a four-bar conserves its energy. In index-2 form the velocity constraint holds to rounding and the
position drifts slowly; projection and the GGL form keep both; accelerations alone keep neither.

Run: python examples/energy_and_drift.py
"""

from pathlib import Path

import mbdae

RUNS = {
    "index 2": {"project": False},
    "index 2, projected": {"project": True},
    "GGLSystem": {"formulation": "ggl"},
    "index 1": {"formulation": "index1", "method": "dop853"},
    "index 1, Baumgarte": {"formulation": "index1", "method": "dop853", "baumgarte": (20.0, 20.0)},
}


def main(end: float = 10.0, rtol: float = 1e-6, plot: str | Path | None = "drift.png") -> dict[str, object]:
    """Print the drift of each formulation, draw it, and return it by name."""
    mech, out = mbdae.load("four_bar"), {}
    print(f"{'formulation':20s} {'max |g|':>10s} {'max |G v|':>10s} {'energy, relative':>17s}")
    sols = [mbdae.solve(mech, (0, end), rtol=rtol, **options) for options in RUNS.values()]
    for name, sol in zip(RUNS, sols, strict=True):
        d = out[name] = mbdae.drift(sol)
        print(f"{name:20s} {d.g_max:10.1e} {d.Gv_max:10.1e} {d.energy_relative:17.1e}")
    if plot:
        from mbdae.studies.drift.figure import drifts
        from mbdae.studies.figures import save

        save(drifts([mbdae.drift(sol).history for sol in sols]), plot)
    return out


if __name__ == "__main__":
    main()
