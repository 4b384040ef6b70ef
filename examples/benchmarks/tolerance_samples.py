"""Statistics of tolerances against a hundred thousand assembled mechanisms.

Dimensions of a slider-crank and of a four-bar deviate by normal distributions, and a pin has a clearance, in contact in
a random direction. All samples are assembled at once by Newton's iteration on the loop equations in complex numbers,

    r e^(i theta) + c + l e^(i phi) = x + i e,    r e^(i theta) + c + l e^(i phi) = d + k e^(i psi),

and some of them by mbdae, too. Mean and standard deviation are compared with those of `mbdae.tolerance` to second
order, in standard errors of the sample.

Run: python examples/benchmarks/tolerance_samples.py [--brief]
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from common import brief, machine, table

import mbdae

Array = np.ndarray
ITERATIONS = 12
CHECKED = 20  # samples that mbdae assembles, too


@dataclass(frozen=True)
class Case:
    """A mechanism, its dimensions with standard deviations in m, a clearance in m, and the loop in complex numbers."""

    model: str
    signal: str
    crank: float
    sizes: dict[str, tuple[float, float]]
    pin: str
    clearance: float
    unknowns: Callable[..., tuple[Array, Array]]  # residual and 2 x 2 Jacobian of the two unknowns


def slider_crank(z: Array, theta: float, p: Array, c: Array) -> tuple[Array, Array]:
    """Unknowns x and phi; dimensions are crank, rod and height of the rail."""
    rod = p[1] * np.exp(1j * z[1])
    return p[0] * np.exp(1j * theta) + c + rod - z[0] - 1j * p[2], np.array([-1 + 0 * rod, 1j * rod])


def four_bar(z: Array, theta: float, p: Array, c: Array) -> tuple[Array, Array]:
    """Unknowns psi and phi; dimensions are crank, coupler, rocker and ground."""
    rocker, coupler = p[2] * np.exp(1j * z[0]), p[1] * np.exp(1j * z[1])
    return p[0] * np.exp(1j * theta) + c + coupler - p[3] - rocker, np.array([-1j * rocker, 1j * coupler])


SLIDER_CRANK = {"joint.crank_pin.xyz.0": (0.1, 2e-3), "frame.rod_tip.xyz.0": (0.35, 2e-3),
                "joint.slider.xyz.2": (0.0, 2e-3)}  # fmt: skip
FOUR_BAR = {"joint.coupler.xyz.0": (1.0, 4e-3), "frame.coupler_tip.xyz.0": (2.0, 6e-3),
            "frame.rocker_tip.xyz.0": (1.5, 5e-3), "joint.rocker.xyz.0": (2.0, 4e-3)}  # fmt: skip
CASES = {
    "slider-crank": Case("slider_crank", "q.slider", 2.5, SLIDER_CRANK, "wrist pin", 3e-3, slider_crank),
    "four-bar": Case("four_bar", "q.rocker", 0.9, FOUR_BAR, "pin", 5e-3, four_bar),
}


def assembled(case: Case, dimensions: Array, gaps: Array, start: Array) -> Array:
    """The first unknown of each sample, (n,): Newton's iteration on all loops at once, from the nominal pose."""
    z = np.repeat(start[:, None], dimensions.shape[1], axis=1)
    for _ in range(ITERATIONS):
        g, J = case.unknowns(z, case.crank, dimensions, gaps)
        rows = np.stack([J.real, J.imag], axis=0).transpose(2, 0, 1)
        step = np.linalg.solve(rows, np.stack([g.real, g.imag], axis=1)[..., None])[..., 0].T
        z = z - step
    assert np.abs(step).max() < 1e-12
    return z[0]


def compared(case: Case, n: int) -> dict[str, float]:
    """Differences of sample and analysis in standard errors, and between both assemblies; seconds of the sample."""
    (names, values, sigmas), rng = zip(*((k, *x) for k, x in case.sizes.items()), strict=True), np.random.default_rng(1)
    found = mbdae.tolerance(
        case.model, "crank", [case.signal], dict(zip(names, sigmas, strict=True)),
        {case.pin: case.clearance}, span=(case.crank, case.crank + 0.01), points=2, sigmas=1, second_order=True,
    )  # fmt: skip
    q = found.curve.q[0]
    start = np.array([q[2], q[0] + q[1]])
    dimensions = np.array(values)[:, None] + np.array(sigmas)[:, None] * rng.standard_normal((len(names), n))
    started = perf_counter()
    x = assembled(case, dimensions, case.clearance * np.exp(2j * np.pi * rng.random(n)), start) - start[0]
    seconds, deviation = perf_counter() - started, float(found.second_order_deviation[0, 0])
    few = [dict(zip(names, p, strict=True)) for p in dimensions[:, :CHECKED].T.tolist()]
    rest = {"start.q.crank": case.crank, "start.v.crank": 0.0}
    runs = mbdae.sweep(case.model, [sample | rest for sample in few], 1e-9, outputs=[f"final {case.signal}"])
    closed = assembled(case, dimensions[:, :CHECKED], np.zeros(CHECKED), start)
    return {
        "mean": float((x.mean() - found.mean_shift[0, 0]) / (x.std() / np.sqrt(n))),
        "deviation": float((x.std(ddof=1) / deviation - 1) * np.sqrt(2 * n)),
        "assembly": float(np.abs(runs[f"final {case.signal}"] - closed).max()),
        "seconds": seconds,
    }


def main(argv: Sequence[str] | None = None) -> dict[str, dict[str, float]]:
    """Print the table; return by case the differences in standard errors, and the largest one from mbdae's assembly."""
    n = 4000 if brief(argv, __doc__) else 100_000
    out, rows = {}, []
    for name, case in CASES.items():
        out[name] = compared(case, n)
        rows.append([name, f"{n}", *(f"{out[name][key]:.3g}" for key in ("mean", "deviation", "assembly", "seconds"))])
    heads = ["mechanism", "samples", "mean, standard errors", "standard deviation, standard errors",
             "difference of assembly (m, rad)", "seconds"]  # fmt: skip
    print(machine() + "\n")
    print(table(heads, rows))
    return out


if __name__ == "__main__":
    main()
