"""Random runs of mechanisms through and near singular configurations: each is determined by its number."""

from functools import partial
from typing import Any, NamedTuple

import branches
import numpy as np

import mbdae

Array = np.ndarray
METHODS = {"pherk5": 0.3, "pherk6": 0.3, "herk5": 0.3, "radau5": 0.1}
MODES: dict[str, tuple[float, dict[str, Any]]] = {
    "default": (0.3, {}),
    "unprojected": (0.2, {"project": False}),
    "projected": (0.35, {"project": True}),
    "ggl": (0.15, {"formulation": "ggl"}),
}
MECHANISMS = (
    "n_four_bar 1",
    "parallelogram",
    "n_four_bar 2",
    "antiparallelogram",
    "kite",
    "n_four_bar 3",
    "slider_crank",
    "change_point",
    "n_four_bar 10",
    "bricard",
    "stewart_platform",
)
CHANGE = 1e-6  # of the speed at the start, or rad/s where it is slow: to measure the growth of perturbations


class Case(NamedTuple):
    """A run to be computed."""

    number: int
    mechanism: str
    method: str
    mode: str
    rtol: float
    title: str
    truth: Any
    changed: Any
    end: float


class Reference:
    """The motion of a mechanism by pherk6 with projection, where no closed form is known: see `branches.Truth`."""

    def __init__(self, mech: mbdae.Mechanism, q: Array, v: Array, end: float) -> None:
        self.branch, self.mech = self, mech
        self.start = q
        options = {"method": "pherk6", "rtol": 1e-11, "project": True}
        self.solution = mbdae.solve(mech, (0, end), q, v, max_steps=200000, **options)
        if not self.solution.success:
            raise RuntimeError(f"no reference: {self.solution.message}")

    def apart(self, a: Array, b: Array) -> Array:
        """Difference a - b of configurations in the tangent, (nv,)."""
        return self.mech.manifold.difference(b, a)

    def off(self, q: Array) -> float:
        """No branches intersect."""
        return 0.0

    def at(self, t: float) -> tuple[Array, Array]:
        """Return q (nq,) and v (nv,)."""
        return self.solution(t)

    def forces(self, t: float) -> tuple[Array, float]:
        """Return lam (ng,), and that there is no rank loss."""
        return self.solution.multipliers(t), 1.0


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _bars(kind: str, rng: np.random.Generator) -> Array:
    """Lengths of ground, crank, coupler and rocker."""
    if kind == "antiparallelogram":
        return np.array([2.0, 1.0, 2.0, 1.0])
    a, b, c = rng.uniform(0.5, 1.0), rng.uniform(1.1, 2.0), rng.uniform(1.1, 2.0)
    if kind == "parallelogram":
        return np.array([b, a, b, a])[rng.permutation(2)[[0, 1, 0, 1]]]
    return np.roll([a, a, b, b] if kind == "kite" else rng.permutation([a, b, c, b + c - a]), rng.integers(4))


def random_branch(kind: str, gravity: float, rng: np.random.Generator) -> tuple[branches.Branch, str]:
    """Return a random branch of a mechanism with a regular start, and its description."""
    s = rng.integers(2) * np.pi + rng.uniform(0.3, np.pi - 0.3)  # bars are in line at multiples of pi
    if kind == "bricard":
        folded = bool(rng.integers(2))
        r1 = rng.uniform(-0.5, np.pi + 0.5)
        return branches.bricard(gravity, r1, folded), f"rod_1 = {r1:.3f}, folded = {folded}"
    if kind == "slider_crank":
        direction, resting = rng.uniform(0, 2 * np.pi), rng.random() < 0.3
        mech, angles, s = branches.slider_crank(gravity, direction), np.array([True, True, False]), s + np.pi / 2

        def slider(s: Array) -> Array:
            columns = (s, np.pi + 0 * s, 0 * s) if resting else (s, -2 * s, 2 * np.cos(s))
            return np.stack(columns, axis=1)

        text = f"gravity towards {direction:.3f}, slider {'rests' if resting else 'moves'}"
        return branches.on_path(mech, slider, angles, s), f"{text}, s = {s:.3f}"
    if kind.startswith("n_four_bar"):
        mech = mbdae.load("n_four_bar", N=int(kind.split()[1]))
        mech.model.gravity.linear = np.array([0.0, 0.0, -gravity])
        return branches.on_path(mech, partial(branches.rows, mech), np.ones(mech.nq), s), f"s = {s:.3f}"
    bars, sign = _bars(kind, rng), {"parallelogram": -1.0, "antiparallelogram": 1.0}.get(kind, rng.choice([-1.0, 1.0]))
    folded = kind == "kite" and rng.random() < 0.3
    mech = branches.four_bar(bars, gravity, kind)
    path = partial(branches.folded_kite, bars) if folded else partial(branches.quadrilateral, bars, sign)
    text = f"bars {np.round(bars, 4).tolist()}, {'folded' if folded else f'sign {sign:g}'}, s = {s:.3f}"
    return branches.on_path(mech, path, np.ones(3), s), text


def _platform(rng: np.random.Generator, end: float) -> tuple[Reference, Reference, str]:
    """The Stewart platform, rotated towards a quarter turn, where its legs' forces alone would not support it."""
    mech = mbdae.load("stewart_platform")
    turn, tilt, height = rng.uniform(0.8, 1.65) * rng.choice([-1, 1]), rng.uniform(-0.2, 0.2), rng.uniform(0.55, 0.8)
    pose = [0.0, 0.0, height, tilt / 2, 0.0, np.sin(turn / 2), np.cos(turn / 2)]
    pose = [*pose[:3], *(np.array(pose[3:]) / np.linalg.norm(pose[3:]))]
    q, v = mech.assemble({"platform": pose}, {"platform": rng.uniform(-0.5, 0.5, 6)})
    text = f"turn {turn:.3f}, tilt {tilt:.3f}, height {height:.3f}"
    return Reference(mech, q, v, end), Reference(mech, q, (1 + CHANGE) * v, end), text


def options(number: int, seed: int) -> tuple[np.random.Generator, str, str, str, float]:
    """Draw mechanism, method, mode and rtol of a run; its generator then draws the start."""
    rng = np.random.default_rng([seed, number])
    method = str(rng.choice(list(METHODS), p=list(METHODS.values())))
    mode = str(rng.choice(list(MODES), p=[share for share, _ in MODES.values()]))
    return rng, MECHANISMS[number % len(MECHANISMS)], method, mode, _between(rng, 1e-10, 1e-4)


def case(number: int, seed: int = 0) -> Case:
    """Draw a run: mechanism, branch, start, speed, span, method, mode and tolerance."""
    rng, kind, method, mode, rtol = options(number, seed)
    if kind == "stewart_platform":
        end = rng.uniform(0.2, 0.5)
        truth, changed, text = _platform(rng, end)
        return Case(number, kind, method, mode, rtol, f"{text}, {end:.3f} s", truth, changed, end)
    gravity = 9.81 * float(rng.integers(2))
    branch, text = random_branch(kind, gravity, rng)
    rate = _between(rng, 0.02 if gravity else 0.3, 10.0) * rng.choice([-1, 1])
    end = rng.uniform(1.5, 4.0) if gravity else min(10.0, 2 * np.pi * rng.uniform(0.8, 2.5) / abs(rate))
    truth, changed = (branches.Truth(branch, rate + c * max(1.0, abs(rate)), end) for c in (0, CHANGE))
    text = f"{text}, gravity {gravity:g}, rate {rate:.4g}, {end:.3f} s"
    return Case(number, kind, method, mode, rtol, text, truth, changed, end)
