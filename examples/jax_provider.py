"""Mechanisms in JAX: the motion as a JAX function, with derivatives forward and reverse.

`pure_callback` calls mbdae; a rule gives JAX the derivative. The ODE in local coordinates has its exact Jacobian, which
JAX multiplies from the right (jvp) or from the left (grad). The accelerations of `Mechanism.at` have an adjoint.

Run: python examples/jax_provider.py (needs ``pip install "mbdae[peers]"``)
"""

import jax
import numpy as np

import mbdae
from mbdae.finite_differences import numerical_jacobian


def right_hand_side(ode):
    """Return x' = F(t, x) of `Mechanism.ode` as a JAX function with a custom JVP."""
    out = jax.ShapeDtypeStruct((ode.n,), float)
    matrix = jax.ShapeDtypeStruct((ode.n, ode.n + 1), float)

    @jax.custom_jvp
    def F(t, x):
        return jax.pure_callback(lambda t, x: ode(float(t), np.asarray(x)), out, t, x, vmap_method="sequential")

    def partials(t, x):
        by_x, by_t, _ = ode.jacobian(float(t), np.asarray(x))
        return np.column_stack([by_t, by_x])

    @F.defjvp
    def rule(primals, tangents):
        J = jax.pure_callback(partials, matrix, *primals, vmap_method="sequential")
        dt, dx = tangents
        return F(*primals), J[:, 0] * dt + J[:, 1:] @ dx

    return F


def accelerations(mech):
    """Return v'(q, v) of `Mechanism.at` as a JAX function with a custom VJP; cotangents of q are those of its tangent.

    It is for mechanisms in which q is a vector: joints of one coordinate.
    """
    out = jax.ShapeDtypeStruct((mech.nv,), float)

    def adjoint(q, v, bar):
        return mech.at(0.0, np.asarray(q), np.asarray(v)).vjp(np.asarray(bar))[:2]

    @jax.custom_vjp
    def vdot(q, v):
        return jax.pure_callback(lambda q, v: mech.at(0.0, np.asarray(q), np.asarray(v)).vdot, out, q, v)

    vdot.defvjp(lambda q, v: (vdot(q, v), (q, v)), lambda at, bar: jax.pure_callback(adjoint, (out, out), *at, bar))
    return vdot


def main(steps: int = 10, end: float = 0.1) -> dict[str, float]:
    """Print and return the error of a run in JAX, and errors of its gradient and of an acceleration's gradient."""
    jax.config.update("jax_enable_x64", True)
    mech = mbdae.load("four_bar")
    q, v = mech.assemble(q={"crank": 0.4}, v={"crank": 2.0})
    ode, h = mech.ode(0.0, q, v), end / steps
    F = right_hand_side(ode)

    def rk4(x, k):
        t = k * h
        a = F(t, x)
        b = F(t + h / 2, x + h / 2 * a)
        c = F(t + h / 2, x + h / 2 * b)
        return x + h / 6 * (a + 2 * b + 2 * c + F(t + h, x + h * c)), None

    def run(x):
        return jax.lax.scan(rk4, x, jax.numpy.arange(steps))[0]

    weights = np.arange(1.0, ode.n + 1)
    exact = mbdae.solve(mech, (0.0, end), q, v, rtol=1e-11)
    error = np.abs(ode.state(end, np.asarray(run(ode.x0)))[0] - exact.q[-1]).max()
    gradient = np.asarray(jax.grad(lambda x: weights @ run(x))(ode.x0))
    tangent = np.asarray(jax.jacfwd(run)(ode.x0))
    quotient = numerical_jacobian(lambda dx: np.asarray(run(ode.x0 + dx)), ode.n, 2e-3)
    vdot = accelerations(mech)
    by_q = np.asarray(jax.grad(lambda q: vdot(q, v)[0])(q))
    by_q_quotient = numerical_jacobian(lambda dq: mech.at(0.0, q + dq, v).vdot[0], mech.nv, 1e-3)
    found = {
        "run": float(error),
        "forward": float(np.abs(tangent - quotient).max()),
        "reverse": float(np.abs(gradient - weights @ quotient).max()),
        "acceleration": float(np.abs(by_q - by_q_quotient).max() / np.abs(by_q).max()),
    }
    print(f"run in JAX by rk4: error {found['run']:.1e}; its derivatives differ from difference quotients by")
    print(f"{found['forward']:.1e} (forward) and {found['reverse']:.1e} (reverse), those of v' by q by", end=" ")
    print(f"{found['acceleration']:.1e}")
    return found


if __name__ == "__main__":
    main()
