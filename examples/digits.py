"""How many digits of published or closed-form solutions are reproduced?

Each problem is run once and compared with its reference. This script prints the table of examples/guide/digits.md.

Run: python examples/digits.py [NAME ...]; --page writes the table into the page
"""

import json
import re
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

from mbdae import Event, drift, load, modes, solve
from mbdae.textbook.problems import TEXTBOOK

ROUNDING = 1e-13  # relative to values of order 1: errors below it differ between machines
HERE = Path(__file__).parent
DATA, PAGE = HERE.parent / "tests" / "data", HERE / "guide" / "digits.md"
TABLE = re.compile(r"(?<=<!-- written by digits.py -->\n\n).*?(?=\n\n<!-- to here -->)", re.S)


class Digits(NamedTuple):
    """One line: the quantity with its unit; the reference as it is printed; the error at the end of the run."""

    what: str
    reference: str
    error: float


def errors(reached: dict[str, float], reference: str) -> list[Digits]:
    """Return a line for each value, in the order of the printed ones."""
    pairs = zip(reached.items(), reference.split(), strict=True)
    return [Digits(what, printed, abs(value - float(printed))) for (what, value), printed in pairs]


# -- test set for initial value problem solvers ------------------------------------------------------------------------

CAR = (
    "0.0493455784275402809122 0.496989460230171153861 1.04174252488542151681 0.373911027265361256927 "
    "-0.0770583684040972357970 0.00744686658723778553466 0.0175568157537232222276 0.770341043779251976443 "
    "-0.00473688659084893324729 -0.00110468033125734368808"
)
CAR_NAMES = *(f"{x}_{y}{unit}" for unit in (", m", "', m/s") for y in "lr" for x in "xy"), "lam_1", "lam_2"
RODS = "-0.331173498825626 0.169737332842786 1.8931929e-4 2.3757512499e-5 -5.3238967706e-6 -8.3633132791e-6"


def car_axis() -> list[Digits]:
    """Car axis, t = 3 s, a mechanism whose base is driven."""
    sol = solve(load("car_axis"), (0, 3), method="pherk6", rtol=1e-11)
    at = [*sol.q[-1][2:], *sol.v[-1][2:], sol.lam[-1][1], sol.lam[-1][2] / 2]
    return errors(dict(zip(CAR_NAMES, at, strict=True)), CAR)


def car_axis_equations() -> list[Digits]:
    """Car axis, t = 3 s, its equations at velocity level."""
    sol = solve(TEXTBOOK["car_axis_equations"](), (0, 3), method="radau9", rtol=1e-9, atol=1e-9)
    return errors(dict(zip(CAR_NAMES, [*sol.y[-1], *sol.z[-1]], strict=True)), CAR)


def flexible_slider_crank() -> list[Digits]:
    """Flexible slider-crank, t = 0.1 s, its published start closed first."""
    sol = solve(load("flexible_slider_crank"), (0, 0.1), method="pherk6", step=0.1 / 9600, t_eval=(0, 0.1))
    x = {name.removeprefix("displacement.rod."): float(column[-1]) for name, column in sol.signals().items()}
    second = x["quarter.y"] - np.sqrt(0.5) * x["middle.y"]
    modes = {"q_1, m": x["middle.y"], "q_2, m": second, "q_3, m": x["middle.x"], "q_4, m": x["pin.x"]}
    return errors({"phi_2, rad": x["q.crank"] + x["q.rod"], "x_3, m": x["q.slider"], **modes}, RODS)


def fekete() -> list[Digits]:
    """Fekete points, t = 1000 s, 160 components."""
    sol = solve(TEXTBOOK["fekete"](), (0, 1000), method="radau9", rtol=1e-9, atol=1e-9)
    p = np.array(json.loads((DATA / "fekete.json").read_text())["end"]["p"])
    off = float(np.abs(sol.y[-1][:60] - p.ravel()).max())
    return [
        Digits("60 coordinates", "in 16 digits", off),
        Digits("20 lam", "-19/4", np.abs(sol.z[-1][:20] + 4.75).max()),
    ]


def andrews() -> list[Digits]:
    """Andrews' mechanism, t = 0.03 s (IFToMM A03)."""
    mech, data = load("andrews_squeezer"), json.loads((DATA / "andrews_squeezer.json").read_text())
    sol = solve(mech, (0, 0.03), method="pherk6", rtol=1e-12)
    order, lines = [data["coordinates"].index(name) for name in mech.joint_names], []
    for key, source in (("end", "in quadruple precision"), ("end_published", "as published, PSIDE")):
        for what, at in (("q", sol.q[-1]), ("v", sol.v[-1])):
            off = float(np.abs(at - np.array(data[key][what], float)[order]).max())
            lines.append(Digits({"q": "7 angles, rad", "v": "7 rates, rad/s"}[what], source, off))
    found = drift(solve(mech, (0, 0.05), method="pherk5", rtol=1e-10))
    return [*lines, Digits("energy to 0.05 s, relative", "torque times angle", found.energy_relative)]


# -- bicycle -----------------------------------------------------------------------------------------------------------


def bicycle() -> list[Digits]:
    """The benchmark bicycle: roots of the straight motion at 0 to 10 m/s."""
    published = json.loads((DATA / "bicycle.json").read_text())["roots"]

    def roots(speed: float) -> np.ndarray:
        found = modes(load("bicycle", speed=float(speed))).eigenvalues
        return np.asarray(found[found != 0])  # those of symmetries are exactly 0

    pairs = [(roots(float(v)), np.array(known) @ [1, 1j]) for v, known in published.items()]
    off = max(np.abs(a[:, None] - b).min(axis=0).max() for a, b in pairs)
    weave = brentq(lambda v: max(x.real for x in roots(v) if abs(x.imag) > 1), 4.2, 4.4, xtol=1e-13)
    near = 6.02 + 0.1 * np.cos(
        np.pi * (np.arange(10) + 0.5) / 10
    )  # where it vanishes it cannot be distinguished from symmetries
    real = Chebyshev.fit(near, [max(x.real for x in roots(v) if abs(x.imag) < 1) for v in near], 9)
    capsize = brentq(real, 6.0, 6.1, xtol=1e-13)
    speeds = errors({"weave speed, m/s": weave, "capsize speed, m/s": capsize}, "4.29238253634111 6.02426201538837")
    return [Digits("44 roots, 1/s", "in 14 decimals", float(off)), *speeds]


def leaned_bicycle() -> list[Digits]:
    """The benchmark bicycle, leaned and turned: nine accelerations, 3-1-3 angles of axes whose x points back."""
    mech, data = load("bicycle"), json.loads((DATA / "bicycle.json").read_text())
    (z, psi, phi, steer), rates = data["place"], np.array(data["rates"])
    lean = Rotation.from_rotvec([psi, 0, 0])
    theirs = (lean * Rotation.from_rotvec([0, 0, phi])).as_matrix()
    R = np.column_stack([theirs[:, 0], theirs[:, 2], -theirs[:, 1]])  # ahead, left, up
    first, second, third = np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), lean.as_matrix()[:, 2]
    axes = np.column_stack([first, second, third])
    moving = np.cross(
        np.column_stack([0 * first, rates[3] * first, rates[3] * first + rates[4] * second]), axes, axis=0
    )
    q, _ = mech.coordinates({"frame": [0, 0, z, *Rotation.from_matrix(R).as_quat()], "fork": steer})
    v = np.concatenate([R.T @ rates[:3], R.T @ axes @ rates[3:6], rates[[7, 6, 8]]])
    vdot = mech.system().derivative(0.0, np.concatenate([q, v, [0.0]]))[0][mech.nv : 2 * mech.nv]
    place = R @ (vdot[:3] + np.cross(v[3:6], v[:3]))
    angles = np.linalg.solve(axes, R @ vdot[3:6] - moving @ rates[3:6])
    off = np.abs(np.array([*place, *angles, vdot[7], vdot[6], vdot[8]]) - data["accelerations"]).max()
    return [Digits("9 accelerations, m/s^2 and rad/s^2", "in 13 decimals", float(off))]


# -- IFToMM library of computational benchmark problems ----------------------------------------------------------------


def pendulum() -> list[Digits]:
    """A01, a pendulum from horizontal rest, 10 s."""
    sol = solve(load("pendulum"), (0, 10), method="pherk6", rtol=1e-12)
    phi = -2 * np.arcsin(np.sqrt(0.5) * ellipj(ellipk(0.5) - np.sqrt(9.81) * sol.t, 0.5)[0])  # k = sin 45 degrees
    exact = np.stack([np.sin(phi), 0 * phi, -np.cos(phi)], axis=1)
    return [
        Digits("its place, m", "elliptic functions", np.abs(sol.q - exact).max()),
        Digits("string, m", "1", drift(sol).g_max),
    ]


def four_bars(N: int = 40) -> list[Digits]:
    """A02, a row of 40 four-bars, ten times through a singular position, 10 s."""
    sol = solve(load("n_four_bar", N=N), (0, 10), method="pherk5", rtol=1e-8)
    cranks = [i for i, name in enumerate(sol.mechanism.joint_names) if name.startswith("crank")]
    spread = float(np.ptp(sol.q[:, cranks], axis=1).max())
    return [
        Digits("cranks differ by, rad", "0", spread),
        Digits("energy, relative", "0", drift(sol).energy_relative),
        Digits("singular positions", "10", abs(len(sol.singular) - 10)),
    ]


def bricard() -> list[Digits]:
    """A04, Bricard's mechanism, with more closures than coordinates, 10 s."""
    found = drift(solve(load("bricard"), (0, 10), method="pherk5", rtol=1e-12))
    return [Digits("all rows, m", "0", found.g_max), Digits("energy, relative", "0", found.energy_relative)]


def governor() -> list[Digits]:
    """A05, a stiff flyball governor, t = 10 s."""
    sol = solve(load("flyball_governor"), (0, 10), method="radau5", rtol=1e-8)
    return errors({"slider, m": sol.signals()["q.slider"][-1]}, "0.6196229")


SLIDER = {  # crank's centre of mass from its axle in m: x at 0.1, 1, 2, 3 and 5 s
    0.04: "0.22678718855 0.21172166139 0.28908519707 0.22848481370 0.24071957373",
    0.0: "0.2263690160 0.2337647503 0.2583044434 0.1977282006 0.2546500855",
}
CRANK = "0.5600314821 10.9135907299 21.0727445228 32.0083277558 54.3333321683"
TIMES = [0.1, 1.0, 2.0, 3.0, 5.0]


def equation_of_motion(centre: float) -> np.ndarray:
    """Return crank and slider at TIMES, (2, 5), from 2 T theta'' + T_theta theta'^2 + V_theta = 0 in one coordinate.

    The rod lies along d = (p - s)/l, p the crank pin and s the slider; the universal joint, whose first axis is x,
    allows rotation by a about x, a' = d'.(e_x x d)/|e_x x d|^2, and thus spin with a' d_x about the rod.
    """

    def place(theta: complex) -> tuple[np.ndarray, np.ndarray]:
        s, c = np.sin(theta), np.cos(theta)
        p, dp = np.array([0, 0.1 - 0.08 * s, 0.12 + 0.08 * c]), np.array([0, -0.08 * c, -0.08 * s])
        x = np.sqrt(0.3**2 - p @ p)
        return np.array([-x, p[1], p[2]]), np.array([p @ dp / x, dp[1], dp[2]])  # l d and its derivative

    def energies(theta: complex) -> np.ndarray:
        d, derivative = place(theta)
        turn = np.array([0, -d[2], d[1]])
        spin = derivative @ turn / (turn @ turn) * d[0] / 0.3
        middle = derivative / 2 * [-1, 1, 1]
        bar = 0.5 * middle @ middle + 4e-3 * derivative @ derivative / 0.09
        T = (2 * derivative[0] ** 2 + bar + 4e-4 * spin**2) / 2
        V = 9.81 * (0.12 * centre * np.cos(theta) + 0.5 * d[2] / 2)
        return np.array([T + (1e-4 + 0.12 * centre**2) / 2, V])

    def rate(t: float, y: np.ndarray) -> list[float]:
        (T, _), (dT, dV) = (found := energies(y[0] + 1e-30j)).real, found.imag / 1e-30
        return [y[1], -(dT * y[1] ** 2 + dV) / (2 * T)]

    found = solve_ivp(rate, (0, 5), [0, 6], method="DOP853", rtol=1e-13, atol=1e-13, t_eval=TIMES).y[0]
    return np.array([found, [-place(theta)[0][0] for theta in found]])


def spatial_slider_crank(centre: float) -> list[Digits]:
    """Slider and crank at five times, and the error of the equation of motion in one coordinate."""
    sol = solve(load("spatial_slider_crank", centre=centre), (0, 5), method="pherk6", rtol=1e-11, t_eval=TIMES)
    lines = errors({f"x({t:g}), m": x for t, x in zip(TIMES, sol.signals()["q.slider"], strict=True)}, SLIDER[centre])
    angles = sol.signals()["q.crank"]
    if centre:
        lines += errors({f"crank({t:g}), rad": a for t, a in zip(TIMES, angles, strict=True)}, CRANK)
    off = np.abs(equation_of_motion(centre) - [angles, sol.signals()["q.slider"]]).max()
    return [*lines, Digits("both, at all times", "equation of motion", float(off))]


def in_the_middle() -> list[Digits]:
    """Spatial slider-crank, the crank's centre of mass in its middle."""
    return spatial_slider_crank(0.04)


def on_the_axle() -> list[Digits]:
    """Spatial slider-crank, the crank's centre of mass on its axle."""
    return spatial_slider_crank(0.0)


def quarter_swing(mass: float, upper: float = np.pi / 2) -> float:
    """Time in s from angle 0 to another: theta' = sqrt(2 g cos theta/(1 - k cos^2 theta)), k = 1/(1 + mass)."""

    def slowness(u: float) -> float:  # theta = pi/2 - u^2
        c = np.sin(u * u)
        return float(2 * u * np.sqrt((1 - c * c / (1 + mass)) / (2 * 9.81 * c))) if u else 2 / np.sqrt(2 * 9.81)

    first, last, bend = np.sqrt(np.pi / 2 - upper), np.sqrt(np.pi / 2), 10 * np.sqrt(mass)
    ends = [first, *(u for u in (last - bend, last - bend / 10) if u > first), last]
    return float(sum(quad(slowness, a, b, epsabs=1e-14, epsrel=1e-13)[0] for a, b in pairwise(ends)))


def cart_pole() -> list[Digits]:
    """Pole of 1 kg on a cart of 1e-6 kg, from horizontal rest."""
    mech, below = load("cart_pole"), Event(lambda t, q, v: q[1] - q[0], terminal=True)
    first = solve(mech, (0, 1), method="pherk6", rtol=1e-12, events=below).t[-1]
    cart, x, _, z = solve(mech, (0, 10), method="pherk6", rtol=1e-12).q[-1]
    swing = quarter_swing(1e-6)
    back = 10 % (4 * swing) - swing  # s after the last passage below the cart, on the side of negative angles
    angle = -brentq(lambda a: quarter_swing(1e-6, a) - min(back, 2 * swing - back), 0.1, np.pi / 2, xtol=1e-15)
    reached = {"quarter swing, s": first, "theta(10), rad": np.arctan2(x - cart, -z)}
    off = max(abs(swing - reached["quarter swing, s"]), abs(angle - reached["theta(10), rad"]))
    return [*errors(reached, "0.4515245356816589 -1.5491294418948283"), Digits("both", "quadrature", float(off))]


ALL = (
    car_axis, car_axis_equations, flexible_slider_crank, fekete, andrews, bicycle, leaned_bicycle, pendulum, four_bars,
    bricard, governor, in_the_middle, on_the_axle, cart_pole,
)  # fmt: skip
PROBLEMS: dict[str, Callable[[], list[Digits]]] = {p.__name__: p for p in ALL}


def markdown(found: dict[str, list[Digits]]) -> str:
    """Return the table of the page."""
    rows = ["| problem | | reference | error |", "|---|---|---|---|"]
    for name, lines in found.items():
        heads = [(PROBLEMS[name].__doc__ or "").rstrip("."), *[""] * len(lines)]
        rows += [f"| {h} | {d.what} | {d.reference} | {d.error:.0e} |" for h, d in zip(heads, lines, strict=False)]
    return "\n".join(rows)


def main(names: Sequence[str] = tuple(PROBLEMS)) -> dict[str, list[Digits]]:
    """Print each problem's lines, and return them."""
    out = {}
    for name in names:
        out[name] = PROBLEMS[name]()
        print(PROBLEMS[name].__doc__)
        for line in out[name]:
            print(f"  {line.what:28s} {line.reference:28s} {line.error:.1e}")
    return out


if __name__ == "__main__":
    found = main([name for name in sys.argv[1:] if name != "--page"] or tuple(PROBLEMS))
    if "--page" in sys.argv:
        PAGE.write_text(TABLE.sub(lambda _: markdown(found), PAGE.read_text()))
