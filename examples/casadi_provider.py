"""Mechanisms in CasADi: the ODE in local coordinates as a callback with its exact Jacobian.

CasADi differentiates through it, as its solvers need: here an implicit midpoint rule by Newton's iteration.

Run: python examples/casadi_provider.py (needs ``pip install "mbdae[peers]"``)
"""

import casadi
import numpy as np

import mbdae


class Callback(casadi.Callback):
    """A function of vectors in CasADi, with a derivative: (name, options) -> callback."""

    def __init__(self, name, options, sizes, shapes, evaluate, derivative=None):
        casadi.Callback.__init__(self)
        self.sizes, self.shapes, self.evaluate, self.derivative = sizes, shapes, evaluate, derivative
        self.construct(name, options)

    def get_n_in(self):
        return len(self.sizes)

    def get_n_out(self):
        return len(self.shapes)

    def get_sparsity_in(self, i):
        return casadi.Sparsity.dense(self.sizes[i], 1)

    def get_sparsity_out(self, i):
        return casadi.Sparsity.dense(*self.shapes[i])

    def eval(self, given):
        return self.evaluate(*(np.array(x)[:, 0] for x in given))

    def has_jacobian(self):
        return self.derivative is not None

    def get_jacobian(self, name, inputs, outputs, options):
        self.kept = self.derivative(name, options)
        return self.kept


def right_hand_side(ode):
    """Return x' = F(t, x) of `Mechanism.ode` as a CasADi function; keep it alive as long as expressions of it."""
    n = ode.n

    def partials(t, x, _):
        by_x, by_t, _ = ode.jacobian(t[0], x)
        return [by_t, by_x]

    def derivative(name, options):
        return Callback(name, options, [1, n, n], [(n, 1), (n, n)], partials)

    return Callback("F", {}, [1, n], [(n, 1)], lambda t, x: [ode(t[0], x)], derivative)


def main(steps: int = 40, end: float = 0.2) -> dict[str, float]:
    """Print and return the error of CasADi's Jacobian, and the order and the error of an implicit midpoint rule."""
    mech = mbdae.load("four_bar")
    q, v = mech.assemble(q={"crank": 0.4}, v={"crank": 2.0})
    ode = mech.ode(0.0, q, v)
    F = right_hand_side(ode)
    t, x = casadi.MX.sym("t"), casadi.MX.sym("x", ode.n)
    J = casadi.Function("J", [t, x], [casadi.jacobian(F(t, x), x)])
    quotient = mbdae.finite_differences.numerical_jacobian(lambda dx: ode(0.0, ode.x0 + dx), ode.n, 1e-3)
    jacobian = float(np.abs(np.array(J(0.0, ode.x0)) - quotient).max())

    x0, x1, h = casadi.MX.sym("x0", ode.n), casadi.MX.sym("x1", ode.n), casadi.MX.sym("h")
    residual = x1 - x0 - h * F(t + h / 2, (x0 + x1) / 2)
    given = casadi.vertcat(x0, t, h)
    newton = casadi.rootfinder("midpoint", "newton", {"x": x1, "p": given, "g": residual}, {"abstol": 1e-12})
    exact, errors = mbdae.solve(mech, (0.0, end), q, v, rtol=1e-11), []
    for n in (steps, 2 * steps):
        at = ode.x0
        for k in range(n):
            at = np.array(newton(x0=at, p=[*at, k * end / n, end / n])["x"])[:, 0]
        errors.append(float(np.abs(ode.state(end, at)[0] - exact.q[-1]).max()))
    found = {"jacobian": jacobian, "error": errors[1], "order": float(np.log2(errors[0] / errors[1]))}
    print(f"CasADi's Jacobian differs from difference quotients by {found['jacobian']:.1e};", end=" ")
    print(f"implicit midpoint: error {found['error']:.1e}, observed order {found['order']:.2f}")
    return found


if __name__ == "__main__":
    main()
