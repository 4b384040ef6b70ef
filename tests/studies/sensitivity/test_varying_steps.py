"""Derivatives of a step by its size, as of the last one to a terminal event: laws and drivers depend on time."""

import numpy as np
import pytest
from chains import tree
from mechanism.forces.test_law_partials import MIXED, PARENTS, kinds_of_forces

import mbdae
from mbdae import Driver, Function, JointTorque, Mechanism, finite_differences
from mbdae.integrate.trajectory.native_trajectory import NativeStep
from mbdae.integrate.trajectory.trajectory import Trajectory
from mbdae.mechanism.discrete_sensitivity.parameter_partials import Parameters

WIDTH = 0.05  # of the step


def driven():
    """A spatial tree with every kind of force but bushings, which are turned too far, and FMUs; two drivers."""
    others = {kind: some for kind, some in kinds_of_forces().items() if kind not in ("Bushing", "FMU")}
    forces = [force for some in others.values() for force in some]
    forces += [JointTorque(joint="revolute_1", torque=Function(function=np.sin, rate=np.cos))]
    forces += [lambda t, q, v: np.cos(3 * t) * np.ones_like(v)]
    drivers = [Driver.polynomial("prismatic_5", (0.1, 0.2, 0.3, 0.4, 0.5)), Driver.harmonic("helical_8", 0.7, 3.0)]
    return Mechanism(tree(MIXED, PARENTS, seed=2), [], forces, drivers=drivers)


METHODS = [
    {"method": "pherk5", "step": 2e-3},
    {"method": "pherk5", "step": 2e-3, "project": True},
    {"method": "herk4", "rtol": 1e-3},  # two half steps
    {"method": "herk4", "rtol": 1e-3, "project": True},
    {"method": "pherk5", "step": 2e-3, "formulation": "ggl"},
    {"method": "radau5", "step": 2e-3},
    {"method": "radau5", "step": 2e-3, "project": True},
    {"method": "radau3", "step": 2e-3, "formulation": "ggl"},
]


@pytest.mark.parametrize("options", METHODS)
@pytest.mark.parametrize("make", [driven, lambda: mbdae.load("car_axis")])
def test_by_its_size(make, options):
    mech = make()
    sol = mbdae.solve(mech, (0.0, 6e-3), **options)
    assert sol.ended, sol.message
    trajectory = Trajectory(sol, Parameters(lambda values: mech, {}))
    i, s = len(trajectory.ts) - 2, trajectory.system
    t, h = float(trajectory.ts[i + 1]), float(trajectory.ts[i + 1] - trajectory.ts[i])
    zero = np.zeros((s.ny, 1)), np.zeros((trajectory.n_carry, 1)), np.zeros((0, 1))
    found = NativeStep(trajectory.core, i).forward(*zero, np.ones(1))[0][:, 0]
    end = trajectory.point_after(i, t)
    expected = finite_differences.numerical_derivative(
        lambda x: s.difference(end, trajectory.point_after(i, t + x)), WIDTH * h
    )
    size = 1 + np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-10 * size)
    assert np.abs(expected).max() > 0.1
