"""Cost of an advance of `mbdae.Simulator` of 1 ms: mean CPU time, and the longest advance.

Run: python examples/benchmarks/simulator.py [ADVANCES]
"""

import sys
from time import perf_counter, process_time

import mbdae
from mbdae import backend

MODELS = {"slider_crank": 0.1, "four_bar": 0.1, "panda_handle": 0.3, "stewart_platform": 0.3}  # ms: goals


def main(advances: int = 2000) -> dict[str, tuple[float, float]]:
    """Print and return the mean CPU time and the longest time of an advance, in ms, by model."""
    print(f"{advances} advances of 1 ms, pherk5, one step each; {backend.status()}; {backend.machine_description()}")
    print(f"{'model':18s} {'mean':>8s} {'longest':>8s} {'goal':>6s}   ms")
    found = {}
    for name, goal in MODELS.items():
        simulator = mbdae.Simulator(name, method="pherk5", step=1e-3, record=False)
        simulator.advance(1e-3)
        longest, cpu = 0.0, process_time()
        for _ in range(advances):
            started = perf_counter()
            simulator.advance(1e-3)
            longest = max(longest, perf_counter() - started)
        found[name] = 1e3 * (process_time() - cpu) / advances, 1e3 * longest
        print(f"{name:18s} {found[name][0]:8.3f} {found[name][1]:8.3f} {goal:6.1f}")
    return found


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
