"""A custom integrator: generalized-alpha on Lie groups in 30 lines, on the equations at a point alone.

    q_1 = q_0 (+) h (v_0 + h ((1/2 - beta) a_0 + beta a_1)),   v_1 = v_0 + h ((1 - gamma) a_0 + gamma a_1)
    (1 - alpha_m) a_1 + alpha_m a_0 = (1 - alpha_f) v_1' + alpha_f v_0',   M v_1' = f + G^T lam,   g(q_1) = 0

The method in index-3 form (Arnold, Bruels, Multibody Syst. Dyn. 18 (2007); Bruels, Cardona, Arnold, Mech. Mach. Theory
48 (2012)) has order 2. `Mechanism.at` gives M, f, G, g and the exact partial derivatives of Newton's matrix; rows may
depend on each other.

Run: python examples/generalized_alpha.py
"""

import numpy as np

import mbdae

RHO = 0.8  # spectral radius at infinite frequency
ITERATIONS, TOLERANCE, ROUNDING = 10, 1e-11, 1e-15  # Newton steps; change of v', relative; rounding of g


def step(mech, t, h, q, v, a, vdot):
    """Return q, v, a and v' at t + h."""
    am, af = (2 * RHO - 1) / (RHO + 1), RHO / (RHO + 1)
    gamma = 0.5 + af - am
    beta, ratio = 0.25 * (gamma + 0.5) ** 2, (1 - af) / (1 - am)
    new, lam = vdot.copy(), np.zeros(mech.ng)
    for _ in range(ITERATIONS):
        a1 = ((1 - af) * new + af * vdot - am * a) / (1 - am)
        q1 = mech.manifold.integrate(q, h * v + h**2 * ((0.5 - beta) * a + beta * a1))
        v1 = v + h * ((1 - gamma) * a + gamma * a1)
        point = mech.at(t + h, q1, v1)
        partials, dq = point.partials(new, lam), beta * h**2 * ratio
        top = point.M - gamma * h * ratio * partials.r_v - dq * partials.r_q
        matrix = np.block([[top, -point.G.T], [point.G, np.zeros((mech.ng, mech.ng))]])
        residual = np.concatenate([point.f + point.G.T @ lam - point.M @ new, -point.g / dq])
        change = np.linalg.lstsq(matrix, residual, rcond=1e-12)[0]
        new, lam = new + change[: mech.nv], lam + change[mech.nv :]
        if np.abs(change[: mech.nv]).max() < TOLERANCE * (1 + np.abs(new).max()) + ROUNDING / dq:
            return q1, v1, a1, new
    raise RuntimeError(f"Newton's iteration does not converge at t = {t:g}")


def run(mech, end, n):
    """Return q and v after n equal steps from the start."""
    q, v = mech.start
    a = vdot = mech.at(0.0, q, v).vdot
    for i in range(n):
        q, v, a, vdot = step(mech, i * end / n, end / n, q, v, a, vdot)
    return q, v


MODELS = {"four_bar": (0.4, 20), "bricard": (0.5, 10), "heavy_top": (0.02, 20)}  # end in s, steps


def main(models=tuple(MODELS)) -> dict[str, list[float]]:
    """Print and return errors of q and v over halved steps, and the observed orders."""
    found = {}
    for name in models:
        end, n = MODELS[name]
        mech = mbdae.load(name)
        exact, errors = mbdae.solve(mech, (0.0, end), rtol=1e-11), []
        for steps in (n, 2 * n, 4 * n):
            q, v = run(mech, end, steps)
            errors.append([np.abs(mech.manifold.difference(exact.q[-1], q)).max(), np.abs(v - exact.v[-1]).max()])
        orders = np.log2(np.divide(errors[-2], errors[-1]))
        print(f"{name:12s} errors of q {errors[-1][0]:.1e}, v {errors[-1][1]:.1e}; orders {orders.round(2)}")
        found[name] = orders.tolist()
    return found


if __name__ == "__main__":
    main()
