"""Flexible bodies: which method resolves their vibrations, and what a beam costs.

The flexible slider-crank of the test set for IVP solvers to 0.1 s, undamped and with overdamped longitudinal modes:
largest errors of the modal coordinates and of their rates at 0.1 s, each relative to its largest value, compared with
fine steps. Then the time per stage of a four-bar whose coupler is rigid, a beam of four modes, or one that shortens by
bending (terms of second order in its coordinates: k^4 numbers of k modes).

Run: python examples/benchmarks/flexible.py
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import brief, machine, medians, microseconds, table
from stages import stage

from mbdae import Driver, Mechanism, Solution, load, solve
from mbdae.discovery import models_directory

RATIOS = {"undamped": (0.0,) * 4, "overdamped": (1e-3, 1e-3, 1.0, 1.0)}
RUNS = (
    ("pherk6", {"rtol": 1e-5}),
    ("pherk6", {"rtol": 1e-7}),
    ("pherk6", {"rtol": 1e-9}),
    ("pherk5", {"rtol": 1e-7}),
    ("radau9", {"rtol": 1e-5}),
    ("radau9", {"rtol": 1e-7}),
    ("radau5", {"rtol": 1e-7}),
    ("alpha", {"step": 1e-4}),
    ("alpha", {"step": 1e-5}),
)


def damped(mech: Mechanism, ratios: tuple[float, ...]) -> Mechanism:
    """Return the mechanism with other damping ratios of its rod, its crank driven by its angle, which `alpha` needs."""
    model, (body,) = mech.model.copy(), mech.model.flexible
    damping = 2 * np.array(ratios) * np.sqrt(body.modal.stiffness * np.diagonal(body.modal.Mq))
    model.flexible = (body.with_modal(replace(body.modal, damping=damping)),)
    crank = Driver.model_validate({"joint": "crank", "motion": {"kind": "polynomial", "coefficients": [0.0, 150.0]}})
    return Mechanism(model, mech.closures, drivers=(crank,), start=mech.start_values)


def accuracy(
    ratios: tuple[float, ...], runs: Sequence[tuple[str, dict]] = RUNS
) -> list[tuple[str, str, int, float, float, float, str]]:
    """Return method, tolerance or step, steps, seconds, errors of q and of its rates, and whether to trust the run."""
    mech = damped(load("flexible_slider_crank"), ratios)
    at = slice(mech.joint_names.index("rod.mode 1"), mech.joint_names.index("rod.mode 4") + 1)

    def values(sol: Solution) -> tuple[np.ndarray, np.ndarray]:
        return sol.q[:, at], sol.v[:, at]

    fine = values(solve(mech, (0, 0.1), method="pherk6", step=0.1 / 12800))
    out = []
    for method, options in runs:
        sol = solve(mech, (0, 0.1), method=method, **options)
        q, v = (
            float((np.abs(x[-1] - y[-1]) / np.abs(y).max(axis=0)).max()) for x, y in zip(values(sol), fine, strict=True)
        )
        words = "not resolved" if sol.status == "doubtful" else ""
        ((name, size),) = options.items()
        out.append((method, f"{name} {size:g}", sol.stats["steps"], sol.stats["seconds"], q, v, words))
    return out


FOUR_BAR = models_directory() / "flexible_four_bar" / "mechanism.toml"
RIGID = """[[body]]
name = "coupler"
parent = "crank"
xyz = [0.3, 0.0, 0.0]
mass = 0.45216
com = [0.45, 0.0, 0.0]
inertia = [0.0, 0.0305208, 0.0305208, 0.0, 0.0, 0.0]
[[frame]]
name = "coupler.C"
parent = "coupler"
xyz = [0.9, 0.0, 0.0]

"""


def four_bar(text: str) -> Mechanism:
    """Return the mechanism of this file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "four_bar.toml"
        path.write_text(text)
        return load(path)


def rigid_four_bar() -> Mechanism:
    """Return the four-bar with a rigid coupler of the same mass."""
    text = FOUR_BAR.read_text()
    start = "[start]\nq = { crank = 1.0471975511965976 }\nv = { crank = 8.0 }\nguess = {" + text.split("guess = {")[1]
    text = text[: text.index("[[flexible]]")] + RIGID + text[text.index("[[closure]]") : text.index("[start]")] + start
    return four_bar(text)


def stiffened_four_bar() -> Mechanism:
    """Return the four-bar whose coupler shortens by bending, so that tension stiffens it."""
    return four_bar(FOUR_BAR.read_text().replace("stiffening = false\n", ""))


def main(argv: Sequence[str] | None = None) -> dict[str, float]:
    """Print the tables; return seconds per stage of the rigid and of the flexible four-bar."""
    short = brief(argv, __doc__)
    print(machine() + "\n")
    header = ["method", "", "steps", "seconds", "error of q", "of q'", ""]
    for name, ratios in list(RATIOS.items())[: 1 if short else None]:
        rows = [
            [m, option, str(n), f"{s:.2g}", f"{q:.0e}", f"{v:.0e}", words]
            for m, option, n, s, q, v, words in accuracy(ratios, RUNS[:1] if short else RUNS)
        ]
        print(f"{name}\n\n{table([*header], rows)}\n")
    steps, repeats = (10, 1) if short else (2000, 7)
    runs = {"rigid": rigid_four_bar(), "flexible": load("flexible_four_bar"), "with stiffening": stiffened_four_bar()}
    found = medians({name: stage(mech, 1e-4, steps, "native") for name, mech in runs.items()}, repeats)
    rows = [[name, microseconds(x), f"{x / found['rigid']:.2f}"] for name, x in found.items()]
    print(table(["coupler", "microseconds per stage", "to the rigid one"], rows))
    return found


if __name__ == "__main__":
    main()
