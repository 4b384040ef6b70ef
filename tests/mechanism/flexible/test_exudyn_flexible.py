"""The four-bar with a flexible coupler against Exudyn's modal body, on the same modes."""

import numpy as np
import pytest
from flexible_bodies import FOUR_BAR

import mbdae
from mbdae.mechanism.flexible.beam_modes import Direction, Elements, Shapes


def test_exudyn_takes_the_same_motion():
    pytest.importorskip("exudyn")
    from crosscheck_exudyn_flexible import four_bar

    mech = mbdae.load(FOUR_BAR)
    modal = mech.model.flexible[0].modal
    direction = Direction(Elements(0.9, 8), "y", "pinned", 2.1e11 * 3.4133333333333334e-10 / (7850 * 64e-6))
    shapes = Shapes.of([direction], [direction.normal_modes(4)])
    r, m, Phi = shapes.points(7850 * 64e-6, {})
    tip = modal.nodes["C"]
    points = np.vstack([r, tip.r]), np.append(m, 0.0), np.concatenate([Phi, tip.Phi[None]]), modal.stiffness
    q, v = mech.start
    at = [mech.joint_names.index(name) for name in ("crank", "coupler", "rocker")]
    (a, b, c), (wa, wb, wc) = q[at], v[at]
    start, t = ((a, a + b, c), (wa, wa + wb, wc)), np.linspace(0, 0.02, 3)
    coarse, fine = (four_bar(points, start, t, n) for n in (200, 400))
    sol = mbdae.solve(mech, (0, 0.02), method="pherk6", step=1e-4, t_eval=t)
    first = mech.joint_names.index("coupler.mode 1")
    ours = np.column_stack([sol.q[:, at[0]], sol.q[:, first : first + 4]])
    np.testing.assert_allclose((4 * fine - coarse) / 3, ours, atol=2e-9)
