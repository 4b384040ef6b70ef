"""Errors of y over time, and the effect of errors in the stages' constraints, in one figure.

    y1' = y1 y2^2 z^2,  y2' = y1^2 y2^2 - 3 y2^2 z,  0 = y1^2 y2 - 1,   exact y = (e^t, e^-2t), z = e^2t

Left: the errors of methods with one step size over time. Right: the constraint of each stage is perturbed,
g = theta with |theta| <= delta, as by a Newton iteration that ends early. y changes by a multiple of delta, whatever
the step size; z, the multiplier of the method, by a multiple of delta / h (Hairer, Lubich, Roche, Lecture Notes in
Mathematics 1409 (1989), chapter 4): smaller steps need more accurate stages.

Run: python examples/errors_over_time.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import mbdae
from mbdae.solution.solution import Solution
from mbdae.textbook.problems import hessenberg_a

METHODS = ("rk4", "herk3", "pherk4", "radau5")
PERTURBED = ("herk3", "pherk4", "radau3")
STEPS = (80, 160, 320, 640)
DELTA, FREQUENCY = 1e-9, 7.7  # size of theta; theta = delta cos(FREQUENCY t / h): the same pattern for each h


def errors(method: str, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (n,), and the largest errors of y and of the method's z there, (n,) each."""
    problem = hessenberg_a()
    sol = mbdae.solve(problem, (0, 1), method=method, step=1 / steps)
    y, z = (np.array(x) for x in zip(*map(problem.exact, sol.t), strict=True))
    return sol.t, np.abs(sol.y - y).max(axis=1), np.abs(sol.z_own - z).max(axis=1)


def perturbation(method: str, steps: int, delta: float = DELTA) -> tuple[float, float]:
    """Return the largest changes of y and of the method's z by perturbed constraints, divided by delta."""
    problem, h = hessenberg_a(), 1 / steps
    moved = replace(problem, name="", g=lambda t, y: problem.g(t, y) + delta * np.cos(FREQUENCY * t / h))

    def run(p: mbdae.Hessenberg) -> Solution:
        return mbdae.solve(p, (0, 1), method=method, step=h)

    a, b = run(problem), run(moved)
    return float(np.abs(a.y - b.y).max() / delta), float(np.abs(a.z_own - b.z_own).max() / delta)


def main(steps: tuple[int, ...] = STEPS, plot: str | Path | None = "errors_over_time.png") -> dict[str, np.ndarray]:
    """Print the changes by delta with their powers of h, draw the figure, return the changes of y and z by method."""
    changes = {name: np.array([perturbation(name, n) for n in steps]) for name in PERTURBED}
    print(f"change / delta at {' '.join(f'{n:>10d}' for n in steps)} steps, power of h")
    for name, found in changes.items():
        for quantity, row in zip("yz", found.T, strict=True):
            power = np.polyfit(-np.log(steps), np.log(row), 1)[0]
            print(f"{name:8s} {quantity}        {' '.join(f'{x:10.2e}' for x in row)}        {power:5.2f}")
    if plot:
        draw(changes, steps, plot)
    return changes


def draw(changes: dict[str, np.ndarray], steps: tuple[int, ...], path: str | Path) -> None:
    """Draw errors over time, and changes over the step size."""
    from mbdae.studies.figures import WIDTH, empty_figure, legend_right, line_style, logarithmic, save, styled

    @styled
    def figure() -> None:
        out = empty_figure(WIDTH, 2.3)
        left, right = out.subplots(1, 2)
        for name in METHODS:
            t, y, _ = errors(name, 80)
            left.plot(t[1:], y[1:], **line_style(name), markevery=16, label=name)
        for name, found in changes.items():
            for quantity, line, row in zip("yz", (":", "-"), found.T, strict=True):
                style = line_style(name) | {"linestyle": line}
                right.plot(1 / np.array(steps), row, **style, label=f"{quantity}, {name}")
        left.set(xlabel="$t$", ylabel="error of $y$, $h$ = 1/80")
        right.set(xlabel="step $h$", ylabel=r"change $/\;\delta$")
        for ax in (left, right):
            logarithmic(ax.yaxis)
            legend_right(ax)
        right.set_xscale("log")
        right.set_xticks(1 / np.array(steps), [f"1/{n}" for n in steps])
        right.tick_params(axis="x", which="minor", labelbottom=False)
        save(out, path)

    figure()


if __name__ == "__main__":
    main()
