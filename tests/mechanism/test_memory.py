"""What a mechanism's workspaces take: they grow with nv^2, not with the nv^3 of Pinocchio's second derivatives."""

import os
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_q, tree

from mbdae.mechanism import pinocchio_data
from mbdae.mechanism.pinocchio_data import make_data

resource = pytest.importorskip("resource")  # Unix

GIGABYTE = 1_000_000_000
RUN = """
import resource, sys
import mbdae
resource.setrlimit(resource.RLIMIT_AS, (4 * 10**9,) * 2)
backend, method, loops = sys.argv[1:]
sol = mbdae.solve(mbdae.load("n_four_bar", N=int(loops)), (0, 0.02), step=0.01, method=method, backend=backend)
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
sys.argv = ["mbdae", "run", "n_four_bar?N=1000", "-t", "0.01"]
main()
"""
PARENTS = [0, 1, 1, 3, 3, 0, 6, 6, 8, 9, 6, 0, 12, 12]  # of a tree with every kind of joint, depth first


def child(program, *arguments):
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, env=environment)


HUNDREDS = [("native", "herk3", 300), ("python", "herk3", 300), ("python", "radau1", 150)]


@pytest.mark.parametrize(("name", "method", "loops"), HUNDREDS)
def test_hundreds_of_loops_take_little_memory(name, method, loops):
    done = child(RUN, name, method, str(loops))
    assert not done.returncode, done.stderr
    end, peak = map(float, done.stdout.split())
    assert end == 0.02
    assert peak < 0.5 * GIGABYTE


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_too_little_memory_is_one_line():
    done = child(TIGHT)
    assert done.returncode == 1
    assert done.stderr.startswith("mbdae: there is not enough memory: ")
    assert done.stderr.count("\n") == 1


USES = """
import mbdae, numpy as np, pinocchio as pin
from mbdae.mechanism.pinocchio_data import LARGEST
for name in ("four_bar", "n_four_bar?N=24"):
    mech = mbdae.load(name)
    s, (q, v) = mech.system(), mech.assemble()
    assert s.nv <= LARGEST
    pin.framesForwardKinematics(s.model, s.data, q)
    tip = s.data.oMf[s.model.nframes - 1].translation
    C = pin.computeCoriolisMatrix(s.model, s.data, q, v)
    assert np.isfinite(tip).all()
    weight = pin.computeGeneralizedGravity(s.model, s.data, q).copy()
    np.testing.assert_allclose(C @ v + weight, pin.nonLinearEffects(s.model, s.data, q, v), atol=1e-9)
    pin.computeAllTerms(s.model, s.data, q, v)
    pin.computeABADerivatives(s.model, s.data, q, v, v)
    pin.computeJointKinematicHessians(s.model, s.data, q)
    pin.computeJointTorqueRegressor(s.model, s.data, q, v, v)
    F, z = s.derivative(0.0, mech.point())
    assert np.array_equal(F, mech.system().derivative(0.0, mech.point())[0])
"""


def test_users_may_call_other_algorithms_on_the_workspace_of_a_system():
    """In a process of its own: without room for their results these write anywhere."""
    done = child(USES)
    assert not done.returncode, done.stderr


@pytest.mark.parametrize("kinds", [JOINTS, ["revolute"], ["free"]], ids=len)
def test_workspace_serves_the_algorithms(kinds, monkeypatch):
    monkeypatch.setattr(pinocchio_data, "LARGEST", 0)
    model, rng, found = tree(kinds, PARENTS[: len(kinds)]), np.random.default_rng(3), []
    q, (v, a) = random_q(model, rng), rng.uniform(-1, 1, (2, model.nv))
    for data in (make_data(model), model.createData()):
        one = [pin.crba(model, data, q, pin.Convention.WORLD).copy(), data.J.copy()]
        one += [pin.rnea(model, data, q, v, a).copy(), pin.nonLinearEffects(model, data, q, v).copy()]
        one += [pin.computeJointJacobians(model, data, q).copy(), pin.computePotentialEnergy(model, data, q)]
        pin.forwardKinematics(model, data, q, v, a)
        one += [x.vector for k in range(1, model.njoints) for x in (data.v[k], data.a[k])]
        found.append([*one, *(place.homogeneous for place in data.oMi)])
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_array_equal(ours, theirs)
