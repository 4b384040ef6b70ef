"""Properties of a model that justify errors of commands, computed without the studies: from the Jacobian of permanent
closures, and from the contents of the mechanism file.
"""

from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

import mbdae
from mbdae import Mechanism
from mbdae.mechanism.forces.coulomb_friction import CoulombFriction

SHORT = {  # s: models that are faster or slower than usual; models with switches change their mode before
    "andrews_squeezer": 0.003, "bouncing_chain": 0.25, "pendulum_on_stop": 0.5, "ratchet": 0.4,
    "slider_crank_with_stop": 0.25, "stick_slip_slider": 0.004, "woodpecker": 0.002,
    "humanoid_stance": 0.02, "stewart_platform": 0.02, "flexible_slider_crank": 0.02,
}  # fmt: skip
RANK = 1e-9


class Facts:
    """Properties of a model, computed without the studies.

    Args:
        name: name of the model.
        drive: its input joint.
    """

    def __init__(self, name: str, drive: str) -> None:
        self.name, self.mech, self.drive = name, mbdae.load(name), drive
        j = self.mech.model.joints[self.mech.model.getJointId(drive)]
        self.single, self.column = j.nv == 1, j.idx_v
        self.rolls = [c for c in self.mech.closures if not c.is_unilateral and not c.within and not self._placed(c)]
        self.windows = [c for c in self.mech.closures if c.within]
        self.switches = bool(self.mech.switches)
        self.several = [j.nv for j in self.mech.model.joints if j.nv > 1]
        self.regularized_interfaces = any(isinstance(f, CoulombFriction) for f in self.mech.forces)
        self.acts = bool(self.mech.drivers or self.mech.motors) or any(
            f.kind in ("joint_pid", "joint_torque", "dc_motor") for f in self.mech.forces if hasattr(f, "kind")
        )

    @property
    def kind(self) -> tuple:
        """Properties that determine which commands give a result, and which an error."""
        features = self.single, self.switches, self.regularized_interfaces, self.acts
        kinds = map(bool, (self.rolls, self.windows, self.several, self.mech.states, self.mech.resets, len(self.rows)))
        return *features, *kinds, self.held == 0, min(self.movable, 2), min(self.free(), 2)

    def _placed(self, closure) -> bool:
        return bool(self.mech.positional[self.mech.rows_of(closure.name)].all())

    @cached_property
    def rows(self) -> np.ndarray:
        """G of the permanent closures, neither unilateral nor with an active range, (m, nv), column by column."""
        permanent = [c for c in self.mech.closures if not (c.is_unilateral or c.within)]
        reduced = Mechanism(self.mech.model, permanent)
        return np.array([reduced.residual(self.mech.start[0], e)[1] for e in np.eye(self.mech.nv)]).T

    @cached_property
    def coarse(self) -> str:
        """Status of a run with the step size of the fit, which is too large for stiff mechanisms."""
        part = SHORT.get(self.name, 0.1) / 4
        return mbdae.solve(self.mech, (0, part), step=part / 4).status

    def free(self, *rows: np.ndarray) -> int:
        """Return null space dimension of G with further rows."""
        rows = np.vstack([self.rows, *rows])
        return self.mech.nv - int(np.linalg.matrix_rank(rows, tol=RANK) if len(rows) else 0)

    @cached_property
    def driven(self) -> np.ndarray:
        """Rows of the drivers except that of the input, (k, nv)."""
        others = [d for d in self.mech.drivers if d.joint != self.drive]
        rates = np.array([self.mech.residual(self.mech.start[0], e)[1] for e in np.eye(self.mech.nv)]).T
        rates_at_rest = self.mech.residual(self.mech.start[0], np.zeros(self.mech.nv))[1]
        at = [r for d in others for r in self.mech.rows_of(d.name)]
        return (rates - rates_at_rest[:, None])[at]

    @cached_property
    def rests(self) -> bool:
        """Whether least squares finds a pose where forces balance, and no direction lowers the potential energy."""
        mech, states = self.mech, np.array(list(self.mech.states.values()))
        system, permanent = mech.system(), [c.name for c in mech.closures if not (c.is_unilateral or c.within)]
        rows = np.array([r for name in permanent for r in mech.rows_of(name)], int)

        def null_space(G: np.ndarray) -> np.ndarray:
            return np.linalg.svd(G)[2][np.linalg.matrix_rank(G, tol=RANK) :].T if len(rows) else np.eye(mech.nv)

        def pose(x: np.ndarray) -> np.ndarray:
            return mech.manifold.integrate(mech.start[0], x)

        def residual(x: np.ndarray) -> np.ndarray:
            q = pose(x)
            gaps, G = system.closures(q, 0.0)
            Z = null_space(G[rows])
            f = system.force(0.0, q, np.zeros(mech.nv), states)[0]
            g = np.where(mech.positional, gaps, 0.0)[rows]
            return np.concatenate([Z @ (Z.T @ f), 100 * g])

        def is_unstable(q: np.ndarray) -> bool:
            """Return whether the potential energy is lower on both sides of the pose in one of 20 directions."""
            Z, zero_v = null_space(system.closures(q, 0.0)[1][rows]), np.zeros(mech.nv)
            for z in (Z @ np.random.default_rng(0).standard_normal((Z.shape[1], 20))).T:
                poses = [mech.manifold.integrate(q, h * z) for h in (1e-3, -1e-3)]
                points = [np.concatenate([x, zero_v, states, [0.0]]) for x in poses]
                closed = [system.project_state(0.0, y)[: mech.nq] for y in points]
                if sum(system.energy(x, zero_v)[1] for x in closed) < 2 * system.energy(q, zero_v)[1] - 1e-9:
                    return True
            return False

        for seed in range(12):
            x = np.random.default_rng(seed).uniform(-3, 3, mech.nv) * (seed > 0)
            found = least_squares(residual, x, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=200)
            if np.abs(found.fun).max() < 1e-7 and not is_unstable(pose(found.x)):
                return True
        return False

    @property
    def movable(self) -> int:
        """The number of degrees of freedom of poses, with fixed drivers."""
        return self.free(self.driven)

    @property
    def held(self) -> int:
        """The number of degrees of freedom left by drivers."""
        rows = [r for d in self.mech.drivers for r in self.mech.rows_of(d.name)]
        rates = np.array([self.mech.residual(self.mech.start[0], e)[1] for e in np.eye(self.mech.nv)]).T
        rates_at_rest = self.mech.residual(self.mech.start[0], np.zeros(self.mech.nv))[1]
        return self.free((rates - rates_at_rest[:, None])[rows])


def drive_of(mech: Mechanism) -> str:
    """Return the first joint with one coordinate, or the first joint."""
    single = [n for n in mech.joint_names if mech.model.joints[mech.model.getJointId(n)].nv == 1]
    return (single or mech.joint_names)[0]
