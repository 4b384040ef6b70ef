"""Least effort for a four-bar, with its FMU in casadi: collocation of the exported equations, solved by IPOPT.

The FMU for model exchange is an ordinary differential equation in local coordinates of the closed loop, with exact
derivatives, so that the search has neither closures nor multipliers. The same optimum as of `optimal_control.py`.

Run: python examples/fmu_casadi.py, with casadi installed.
"""

import tempfile
import zipfile
from pathlib import Path

import mbdae

TO, DURATION = 0.6, 1.0  # rad, s; from rest at 1.2 rad
COLLOCATION = 167.076509  # N^2 m^2 s, of the reduced equation of motion
DEGREE = 4  # of the polynomials on an interval


def export_four_bar(folder: Path) -> Path:
    """Write the FMU of a four-bar with a motor, and return the folder of its content."""
    mech = mbdae.load("four_bar")
    torque = mbdae.JointTorque(joint="crank", torque=mbdae.Input(name="motor", unit="N m"))
    driven = mbdae.Mechanism(mech.model, mech.closures, [torque], start=mech.start_values, title="Driven four-bar")
    unit = mbdae.export(driven, folder / "four_bar.fmu", kind="me", outputs=["q.crank", "v.crank"])
    with zipfile.ZipFile(unit.path) as file:
        file.extractall(folder / "four_bar")
    return folder / "four_bar"


def main(intervals: int = 20) -> dict[str, float]:
    """Print the least integral of the squared torque, and return it."""
    import casadi

    with tempfile.TemporaryDirectory() as folder:
        dae = casadi.DaeBuilder("four_bar", str(export_four_bar(Path(folder))))
        equation = dae.create("equation", ["x", "u"], ["ode", "y"])
        n, size = equation.size1_in(0), DURATION / intervals
        by_node, to_end, weights = casadi.collocation_coeff(casadi.collocation_points(DEGREE, "legendre"))
        starts, inner = casadi.MX.sym("starts", n, intervals + 1), casadi.MX.sym("inner", n, intervals * DEGREE)
        u, effort = casadi.MX.sym("u", 1, intervals * DEGREE), 0
        _, reached = equation(starts[:, -1], 0)
        zero = [starts[:, 0], reached - casadi.DM([TO, 0.0])]  # from rest, where the coordinates are 0
        for k in range(intervals):
            own = range(k * DEGREE, (k + 1) * DEGREE)
            values = casadi.horzcat(starts[:, k], inner[:, own])
            rates = casadi.horzcat(*(equation(inner[:, j], u[:, j])[0] for j in own))
            zero += [casadi.vec(values @ by_node - size * rates), values @ to_end - starts[:, k + 1]]
            effort += size * (u[:, own] ** 2) @ weights
        unknown = casadi.vertcat(casadi.vec(starts), casadi.vec(inner), casadi.vec(u))
        options = {"hessian_approximation": "limited-memory", "tol": 1e-9, "print_level": 0, "sb": "yes"}
        problem = {"x": unknown, "f": effort, "g": casadi.vertcat(*zero)}
        search = casadi.nlpsol("search", "ipopt", problem, {"ipopt": options, "print_time": False})
        found = float(search(x0=0, lbg=0, ubg=0)["f"])
    print(f"least effort {found:.8g} N^2 m^2 s, by collocation of the reduced equation {COLLOCATION:.9g}")
    return {"effort": found, "excess": found / COLLOCATION - 1}


if __name__ == "__main__":
    main()
