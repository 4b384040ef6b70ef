"""Memory of a mechanism's workspaces: it grows with nv^2, not with the nv^3 of Pinocchio's second derivatives."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_q, tree

import mbdae
from mbdae.mechanism.tree import pinocchio_data
from mbdae.mechanism.tree.pinocchio_data import make_data
from mbdae.mechanism.tree.tree_terms import sparse_inertia, update_inertia

resource = pytest.importorskip("resource")  # Unix

GIGABYTE = 1_000_000_000
RUN = """
import resource, sys
import mbdae
resource.setrlimit(resource.RLIMIT_AS, (4 * 10**9,) * 2)
backend, method, loops = sys.argv[1:]
sol = mbdae.solve(mbdae.load("n_four_bar", N=int(loops)), (0, 0.02), step=0.02, method=method, backend=backend)
if sys.platform == "linux":  # where ru_maxrss begins with that of the process that started this one
    peak = next(1024 * int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
else:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(sol.t[-1], peak)
"""
TIGHT = """
import resource, sys
from mbdae.__main__ import main
import mbdae.integrate.solve, mbdae.studies.drift.drift
taken = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + 5 * 10**7,) * 2)
sys.argv = ["mbdae", "solve", "n_four_bar?N=1000", "-t", "0.01"]
main()
"""
PARENTS = [0, 1, 1, 3, 3, 0, 6, 6, 8, 9, 6, 0, 12, 12]  # of a tree with every kind of joint, depth first


def child(program, *arguments):
    path = os.pathsep.join(filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path}
    return subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, env=environment)


HUNDREDS = [("native", "herk3", 200), ("python", "herk3", 200), ("python", "radau1", 150)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method", "loops"), HUNDREDS)
def test_hundreds_of_loops_take_little_memory(name, method, loops):
    done = child(RUN, name, method, str(loops))
    assert not done.returncode, done.stderr
    end, peak = map(float, done.stdout.split())
    assert end == 0.02
    assert peak < 0.5 * GIGABYTE


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_too_little_memory_is_one_line():
    done = child(TIGHT)
    assert done.returncode == 1
    assert done.stderr.startswith("mbdae: not enough memory: ")
    assert done.stderr.count("\n") == 1


USES = """
import mbdae, numpy as np, pinocchio as pin
from chains import tree
from mbdae.mechanism import forces
from mbdae.mechanism.forces.force import ForceElement, PythonForce

class Gravity(ForceElement):  # twice the weight, by algorithms that mbdae does not call
    def __init__(self, model, data):
        super().__init__("gravity")
        self.model, self.data = model, data

    def generalized_force(self, t, q, v):
        pin.computeCoriolisMatrix(self.model, self.data, q, v)
        pin.computeJointKinematicHessians(self.model, self.data, q)
        return 0.0, -pin.computeGeneralizedGravity(self.model, self.data, q)

class Custom(PythonForce):
    name = "gravity"

    def bind(self, model, data):
        return Gravity(model, data)

forces.PYTHON_FORCES += (Custom,)  # as an entry point does
chain = tree(["rx"] * 60, range(60))
heavy = mbdae.Mechanism(chain, forces=[Custom()])
for mech in (mbdae.load("four_bar"), mbdae.load("n_four_bar?N=24"), mbdae.Mechanism(chain), heavy):
    s, (q, v) = mech.system(), mech.assemble()
    v = v + 0.1 if not mech.ng else v
    before = s.derivative(0.0, mech.point())
    pin.framesForwardKinematics(s.model, s.data, q)
    tip = s.data.oMf[s.model.nframes - 1].translation
    C = pin.computeCoriolisMatrix(s.model, s.data, q, v)
    assert np.isfinite(tip).all()
    weight = pin.computeGeneralizedGravity(s.model, s.data, q).copy()
    np.testing.assert_allclose(C @ v + weight, pin.nonLinearEffects(s.model, s.data, q, v), atol=1e-7)
    pin.computeAllTerms(s.model, s.data, q, v)
    pin.computeABADerivatives(s.model, s.data, q, v, v)
    pin.computeJointKinematicHessians(s.model, s.data, q)
    pin.computeJointTorqueRegressor(s.model, s.data, q, v, v)
    for after in (s.derivative(0.0, mech.point()), mech.system().derivative(0.0, mech.point())):
        np.testing.assert_array_equal(after[0], before[0])
falls = [m.system().derivative(0.0, m.point())[0][60:120] for m in (mbdae.Mechanism(chain), heavy)]
np.testing.assert_allclose(falls[1], 2 * falls[0], rtol=1e-6)  # from rest
"""


@pytest.mark.slow
def test_users_may_call_other_algorithms_on_the_data_of_a_system():
    """In another process: without room for their results these write anywhere. 60 hinges exceed `MAX_COMPLETE_NV`."""
    done = child(USES)
    assert not done.returncode, done.stderr


def test_room_for_all_algorithms_is_made_when_it_is_asked_for():
    """The data of users is no part of a run, and nothing that a system computes lands in it."""
    mech = mbdae.load("n_four_bar?N=60")
    system = mech.system()
    system.derivative(0.0, mech.point())
    assert "data" not in vars(system)
    assert system.data is system.data
    assert system.data is not system.workspace
    assert not np.any(system.data.M)


@pytest.mark.parametrize("kinds", [JOINTS, ["revolute"], ["free"]], ids=len)
def test_workspace_serves_the_algorithms(kinds, monkeypatch):
    monkeypatch.setattr(pinocchio_data, "MAX_COMPLETE_NV", 0)
    model, rng, found = tree(kinds, PARENTS[: len(kinds)]), np.random.default_rng(3), []
    q, (v, a) = random_q(model, rng), rng.uniform(-1, 1, (2, model.nv))
    for data in (make_data(model), model.createData()):
        one = [update_inertia(model, data, q).copy(), data.J.copy()]
        one += [pin.rnea(model, data, q, v, a).copy(), pin.nonLinearEffects(model, data, q, v).copy()]
        one += [pin.computeJointJacobians(model, data, q).copy(), pin.computePotentialEnergy(model, data, q)]
        pin.forwardKinematics(model, data, q, v, a)
        one += [x.vector for k in range(1, model.njoints) for x in (data.v[k], data.a[k])]
        found.append([*one, *(place.homogeneous for place in data.oMi)])
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("kinds", [JOINTS, ["revolute"], ["free"]], ids=len)
def test_entries_of_the_mass_matrix_are_those_of_pinocchio(kinds):
    """By composite inertias, without the zeros between branches; with the inertia of rotors."""
    model, rng = tree(kinds, PARENTS[: len(kinds)]), np.random.default_rng(5)
    q = random_q(model, rng)
    model.armature = rng.uniform(0.1, 1.0, model.nv)
    data, above = model.createData(), list[int]()
    for parent in list(data.parents_fromRow):
        above.append(0 if parent < 0 else above[parent] + 1)
    upper = np.triu(pin.crba(model, data, q))
    found = sparse_inertia(model, make_data(model), q)
    np.testing.assert_allclose(found.toarray(), upper + np.triu(upper, 1).T, rtol=0, atol=1e-13 * upper.max())
    assert found.nnz == model.nv + 2 * sum(above)
