"""The exact derivatives of the compiled core against those of Python, at random states off the manifold."""

import numpy as np
import pytest
from chains import JOINTS, random_q, tree
from driven import DRIVEN
from in_core import IN_CORE
from mechanism.forces import test_force_runs
from mechanism.forces.test_law_partials import kinds_of_forces, samples
from mechanism.formulations.test_derivatives import CLOSURES, DRIVERS

from mbdae import Mechanism, backend, load
from mbdae.errors import StepError
from mbdae.mechanism.formulations.equation_partials import equation_partials

pytestmark = pytest.mark.native
IN_PYTHON = {type(test_force_runs.ON_FOUR_BAR[name]).__name__ for name in test_force_runs.IN_PYTHON}


def compare(mech, tolerance=1e-12, states=4):
    rng, compared = np.random.default_rng(5), 0
    for _ in range(states):
        native = mech.system(native=backend.load())
        native.expand()
        q, v, s = random_q(mech.model, rng), rng.uniform(-2, 2, mech.nv), rng.uniform(-1, 1, native.ns)
        t, y = rng.uniform(0, 2), np.concatenate([q, v, s, [0.3]])
        try:
            native.derivative(t, y)  # in Python: the rank
        except StepError:  # a bushing with a flipped frame, or a singular configuration
            continue
        rows, vdot = np.array(native.core.rows, int), rng.uniform(-1, 1, mech.nv)
        lam = np.zeros(native.ng)
        lam[rows] = rng.uniform(-3, 3, len(rows))
        expected = equation_partials(native, t, q, y[mech.model.nq :], vdot, lam[rows], rows)
        M, K, D, G, B, g_t = native.core.partials(t, q, y[mech.model.nq :], vdot, lam)
        compared += 1
        nv = mech.nv
        pairs = {"K": (K, expected.K), "D": (D, expected.D), "B": (B, expected.B), "G": (G, expected.G)}
        pairs |= {"M": (M, expected.E[:nv, :nv]), "g_t": (g_t, -expected.L[-1])}
        for name, (found, known) in pairs.items():
            scale = max(1.0, np.abs(known).max(initial=0.0))
            np.testing.assert_allclose(found, known, rtol=0, atol=tolerance * scale, err_msg=name)
    assert compared > 1


@pytest.mark.parametrize("name", IN_CORE)
def test_every_model(name):
    compare(load(name))


@pytest.mark.parametrize("name", DRIVEN)
def test_driven_mechanisms(name):
    compare(DRIVEN[name]())


@pytest.mark.parametrize("kind", JOINTS)
def test_closures_on_every_kind_of_joint(kind):
    compare(
        Mechanism(tree([kind, kind, "py", kind, "rx", kind], [0, 1, 2, 3, 2, 5], seed=3), CLOSURES, drivers=DRIVERS)
    )


@pytest.mark.parametrize("name", [name for name in kinds_of_forces() if name not in IN_PYTHON])
def test_every_kind_of_force(name):
    for mech in samples(name):
        compare(mech)
