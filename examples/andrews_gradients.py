"""Derivatives of Andrews' mechanism at 0.03 s with respect to its 42 parameters, in two ways, to nine digits.

The published equations, with a complex step in each parameter (a derivative without a difference), are solved for the
accelerations and integrated by Gragg's midpoint rule with extrapolation, in extended precision. They are compared with
the tangent of a run of mbdae on its model. The output is the tables of examples/guide/andrews_gradients.md, after some
minutes.

Run: python examples/andrews_gradients.py; --page writes the table into the page

Sources: Hairer, Wanner, Solving Ordinary Differential Equations II, section VII.7, and the Test Set for IVP Solvers,
problem andrews, for equations and parameters; Hairer, Noersett, Wanner I, section II.9, for the extrapolation.
"""

import json
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mbdae import load, sensitivity, solve

HERE = Path(__file__).parent
DATA = json.loads((HERE.parent / "tests" / "data" / "andrews_squeezer.json").read_text())
PAGE = HERE / "guide" / "andrews_gradients.md"
TABLE = re.compile(r"(?<=<!-- written by andrews_gradients.py -->\n\n).*?(?=\n\n<!-- to here -->)", re.S)
NUMBERS: dict[str, float] = DATA["parameters"]
ANGLES: list[str] = DATA["coordinates"]
STEP = 1e-30  # of a parameter, along the imaginary axis

Array = np.ndarray

# A vector to the point P is a sum of lengths along angles: name, sign, angles that are added, quarter turns. The
# constraints equate each of the three others, from a fixed point to P, with the one through the crank.
CRANK = [("rr", 1, (0,), 0), ("d", -1, (0, 1), 0)]
OTHERS = (
    (("xb", "yb"), [("ss", -1, (2,), 1)], (2,)),
    (("xa", "ya"), [("e", -1, (3, 4), 1), ("zt", 1, (4,), 0)], (3, 4)),
    (("xa", "ya"), [("zf", 1, (5, 6), 0), ("u", -1, (6,), 1)], (5, 6)),
)  # with the angle of the last body


class Squeezer:
    """The published equations for n sets of parameters at once: angles and rates are (7, n).

    Args:
        p: the parameters by their published names, (n,) each.
        sin: sine of arrays of the parameters' type.
        cos: cosine.
    """

    def __init__(self, p: dict[str, Array], sin: Callable = np.sin, cos: Callable = np.cos) -> None:
        self.p, self.sin, self.cos = p, sin, cos
        self.zero = 0 * p["m1"]

    def mass(self, q: Array) -> Array:
        """M, (7, 7, n)."""
        p = self.p
        M = np.array([[self.zero] * 7] * 7)
        rod, arm = p["e"] - p["ea"], p["zf"] - p["fa"]
        c, s4, s6 = self.cos(q[1]), self.sin(q[3]), self.sin(q[5])
        M[0, 0] = p["m1"] * p["ra"] ** 2 + p["m2"] * (p["rr"] ** 2 - 2 * p["da"] * p["rr"] * c + p["da"] ** 2)
        M[0, 0] += p["i1"] + p["i2"]
        M[0, 1] = M[1, 0] = p["m2"] * (p["da"] ** 2 - p["da"] * p["rr"] * c) + p["i2"]
        M[1, 1] = p["m2"] * p["da"] ** 2 + p["i2"]
        M[2, 2] = p["m3"] * (p["sa"] ** 2 + p["sb"] ** 2) + p["i3"]
        M[3, 3] = p["m4"] * rod**2 + p["i4"]
        M[3, 4] = M[4, 3] = p["m4"] * (rod**2 + p["zt"] * rod * s4) + p["i4"]
        M[4, 4] = p["m4"] * (p["zt"] ** 2 + 2 * p["zt"] * rod * s4 + rod**2) + p["m5"] * (p["ta"] ** 2 + p["tb"] ** 2)
        M[4, 4] += p["i4"] + p["i5"]
        M[5, 5] = p["m6"] * arm**2 + p["i6"]
        M[5, 6] = M[6, 5] = p["m6"] * (arm**2 - p["u"] * arm * s6) + p["i6"]
        M[6, 6] = p["m6"] * (arm**2 - 2 * p["u"] * arm * s6 + p["u"] ** 2) + p["m7"] * (p["ua"] ** 2 + p["ub"] ** 2)
        M[6, 6] += p["i6"] + p["i7"]
        return M

    def force(self, q: Array, v: Array) -> Array:
        """f, (7, n)."""
        p, f = self.p, np.array([self.zero] * 7)
        rod, arm = p["e"] - p["ea"], p["zf"] - p["fa"]
        c, s = self.cos(q[2]), self.sin(q[2])
        x, y = p["sd"] * c + p["sc"] * s + p["xb"] - p["xc"], p["sd"] * s - p["sc"] * c + p["yb"] - p["yc"]
        tension = -p["c0"] * (1 - p["l0"] / (x * x + y * y) ** 0.5)
        s2, c4, c6 = self.sin(q[1]), self.cos(q[3]), self.cos(q[5])
        f[0] = p["mom"] - p["m2"] * p["da"] * p["rr"] * v[1] * (v[1] + 2 * v[0]) * s2
        f[1] = p["m2"] * p["da"] * p["rr"] * v[0] ** 2 * s2
        f[2] = tension * x * (p["sc"] * c - p["sd"] * s) + tension * y * (p["sd"] * c + p["sc"] * s)
        f[3] = p["m4"] * p["zt"] * rod * v[4] ** 2 * c4
        f[4] = -p["m4"] * p["zt"] * rod * v[3] * (v[3] + 2 * v[4]) * c4
        f[5] = -p["m6"] * p["u"] * arm * v[6] ** 2 * c6
        f[6] = p["m6"] * p["u"] * arm * v[5] * (v[5] + 2 * v[6]) * c6
        return f

    def _to_P(self, parts: Sequence, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """A vector (2, n), its Jacobian (2, 7, n), and its second derivative without terms of v', (2, n)."""
        at, bend, J = (np.array([self.zero] * 2) for _ in range(2)), None, np.array([[self.zero] * 7] * 2)
        at, bend = at
        for name, sign, angles, quarter in parts:
            size, a, w = sign * self.p[name], sum(q[i] for i in angles), sum(v[i] for i in angles)
            c, s = self.cos(a), self.sin(a)
            along, across = np.array([c, s]), np.array([-s, c])
            if quarter:
                along, across = across, -along
            at, bend = at + size * along, bend - size * along * w**2
            for i in angles:
                J[:, i] = J[:, i] + size * across
        return at, J, bend

    def closures(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """The gaps g (6, n), G (6, 7, n) and Gdot v (6, n)."""
        crank, found = self._to_P(CRANK, q, v), []
        for fixed, parts, _ in OTHERS:
            at, J, bend = self._to_P(parts, q, v)
            found.append((crank[0] - at - np.array([self.p[x] for x in fixed]), crank[1] - J, crank[2] - bend))
        g, G, bias = (np.concatenate(x) for x in zip(*found, strict=True))
        return g, G, bias

    def acceleration(self, q: Array, v: Array) -> Array:
        """Solve for v' from M v' = f + G^T lam, G v' + Gdot v = 0, (7, n)."""
        _, G, bias = self.closures(q, v)
        return saddle(self.mass(q), G, G, self.force(q, v), -bias)

    def start(self) -> Array:
        """The angles at the start, (7, n): Theta = 0, all closures closed."""
        q = np.array([self.zero + x for x in DATA["start"]["q"]])
        others, at_rest = [0, 2, 3, 4, 5, 6], 0 * q
        for _ in range(8):
            g, G, _ = self.closures(q, at_rest)
            q[others] = q[others] - eliminate(np.concatenate([G[:, others], g[:, None]], axis=1))
        return q


def saddle(M: Array, G: Array, Ghat: Array, f: Array, rhs: Array) -> Array:
    """Solve for v' (7, n) of M v' - G^T lam = f, Ghat v' = rhs."""
    r, zero = len(G), np.zeros_like(M[:1, :1])
    above = np.concatenate([M, -np.swapaxes(G, 0, 1), f[:, None]], axis=1)
    below = np.concatenate([Ghat, np.repeat(np.repeat(zero, r, 0), r, 1), rhs[:, None]], axis=1)
    return eliminate(np.concatenate([above, below]))[:7]


def eliminate(A: Array) -> Array:
    """Solve A[:, :m] x = A[:, m] for x (m, n), A (m, m + 1, n): Gauss elimination with one pivot order for all."""
    A, m = A.copy(), len(A)
    for k in range(m):
        i = k + int(np.argmax(np.abs(A[k:, k, 0])))
        A[[k, i]] = A[[i, k]]
        A[k, k:] = A[k, k:] / A[k, k]
        for others in (slice(k), slice(k + 1, m)):
            A[others, k + 1 :] -= A[others, k : k + 1] * A[k, k + 1 :]
    return A[:, m]


def extrapolated(rate: Callable[[Array], Array], y: Array, H: float, columns: int = 8) -> Array:
    """One step of size H by the midpoint rule with 2, 4, 6, ... substeps, extrapolated in h^2."""
    table: list[Array] = []
    for j in range(1, columns + 1):
        n, h = 2 * j, H / (2 * j)
        last, current = y, y + h * rate(y)
        for _ in range(n - 1):
            last, current = current, last + 2 * h * rate(current)
        row = [current]
        for k in range(1, j):
            row.append(row[k - 1] + (row[k - 1] - table[k - 1]) / ((j / (j - k)) ** 2 - 1))
        table = row
    return table[-1]


def published(steps: int, names: Sequence[str] = tuple(NUMBERS), end: float = 0.03) -> tuple[Array, Array]:
    """(q, v) at the end, (14,), and their derivatives with respect to published parameters, (14, k)."""
    p = {name: np.full(len(names), x, np.clongdouble) for name, x in NUMBERS.items()}
    for k, name in enumerate(names):
        p[name][k] += 1j * STEP
    machine = Squeezer(p)
    y = np.concatenate([q := machine.start(), 0 * q])

    def rate(y: Array) -> Array:
        return np.concatenate([y[7:], machine.acceleration(y[:7], y[7:])])

    for _ in range(steps):
        y = extrapolated(rate, y, np.longdouble(end) / steps)
    return y.real[:, 0].astype(float), (y.imag / STEP).astype(float)


# Parameters of the model that depend on each published parameter, with factors.
MODEL: dict[str, dict[str, float]] = {
    **{f"m{i + 1}": {f"joint.{ANGLES[j]}.mass": 1} for i, j in enumerate((0, 1, 2, 3, 4, 5, 6))},
    **{f"i{i + 1}": {f"joint.{ANGLES[j]}.inertia.2": 1} for i, j in enumerate((0, 1, 2, 3, 4, 5, 6))},
    "rr": {"joint.Theta.xyz.0": 1},
    "ra": {"joint.beta.com.0": 1},
    "d": {"frame.P2.xyz.0": -1},
    "da": {"joint.Theta.com.0": -1},
    "ss": {"frame.P3.xyz.1": -1},
    "sa": {"joint.gamma.com.1": -1},
    "sb": {"joint.gamma.com.0": 1},
    "sc": {"frame.D.xyz.1": -1},
    "sd": {"frame.D.xyz.0": 1},
    "e": {"frame.P4.xyz.1": -1, "joint.Phi.com.1": -1},
    "ea": {"joint.Phi.com.1": 1},
    "zt": {"joint.Phi.xyz.0": 1},
    "ta": {"joint.delta.com.0": 1},
    "tb": {"joint.delta.com.1": 1},
    "zf": {"frame.P6.xyz.0": 1, "joint.Omega.com.0": 1},
    "fa": {"joint.Omega.com.0": -1},
    "u": {"joint.Omega.xyz.1": -1},
    "ua": {"joint.epsilon.com.1": -1},
    "ub": {"joint.epsilon.com.0": -1},
    "xa": {"joint.delta.xyz.0": 1, "joint.epsilon.xyz.0": 1},
    "ya": {"joint.delta.xyz.1": 1, "joint.epsilon.xyz.1": 1},
    "xb": {"joint.gamma.xyz.0": 1},
    "yb": {"joint.gamma.xyz.1": 1},
    "xc": {"frame.C.xyz.0": 1},
    "yc": {"frame.C.xyz.1": 1},
    "c0": {"force.spring.stiffness": 1},
    "l0": {"force.spring.length": 1},
    "mom": {"force.drive.torque.value": 1},
}


def computed(names: Sequence[str] = tuple(NUMBERS), end: float = 0.03, **options: float | str) -> tuple[Array, Array]:
    """(q, v) at the end of a run, (14,), and their derivatives with respect to published parameters, (14, k)."""
    mech = load("andrews_squeezer")
    parts = sorted({part for name in names for part in MODEL[name]})
    sol = solve(mech, (0, end), **options)
    found = sensitivity(sol, parts)
    order = [mech.joint_names.index(name) for name in ANGLES]
    chain = np.array([[MODEL[name].get(part, 0.0) for name in names] for part in parts])
    derivatives = np.concatenate([found.q[-1][order], found.v[-1][order]]) @ chain
    return np.concatenate([sol.q[-1][order], sol.v[-1][order]]), derivatives


def markdown(found: Array) -> str:
    """The two tables of the page, from all derivatives, (14, 42)."""
    lines = []
    for title, part in (("angle, rad", found[:7]), ("rate, rad/s", found[7:])):
        lines += [f"| {title} | " + " | ".join(ANGLES) + " |", "|---" * 8 + "|"]
        for name, row in zip(NUMBERS, part.T, strict=True):
            lines.append(f"| {name} | " + " | ".join(f"{x:.8e}" for x in row) + " |")
        lines.append("")
    return "\n".join(lines).strip()


def main(
    steps: int = 250, names: Sequence[str] = tuple(NUMBERS), end: float = 0.03, **options: float | str
) -> dict[str, Array]:
    """Compute the derivatives twice, and print the number of common digits."""
    options = options or {"method": "pherk6", "step": 1.5e-5}
    (y, derivatives), (mbdae_y, mbdae_derivatives) = published(steps, names, end), computed(names, end, **options)
    off = np.abs(mbdae_derivatives / derivatives - 1)
    print(f"(q, v) at {end} s differ by {np.abs(y - mbdae_y).max():.1e}")
    print(f"derivatives differ by {off.max():.1e} of their size, in the median by {np.median(off):.1e}")
    return {"y": y, "derivatives": derivatives, "off": off}


if __name__ == "__main__":
    result = main()
    if "--page" in sys.argv:
        PAGE.write_text(TABLE.sub(lambda _: markdown(result["derivatives"]), PAGE.read_text()))
    else:
        print(markdown(result["derivatives"]))
