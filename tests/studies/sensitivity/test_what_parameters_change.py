"""Parameters that change more than values are rejected by name; constraint violations are removed by projections."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_inertia

import mbdae
from mbdae import JointPID, backend
from mbdae.errors import InputError
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value


def with_pid(**more):
    return mbdae.load("four_bar", forces=[JointPID(name="pid", joint="crank", reference=0.3, kp=2.0, **more)])


def test_a_joint_axis_is_rejected():
    sol = mbdae.solve(mbdae.load("spatial_slider_crank"), (0.0, 0.05), step=0.01)
    with pytest.raises(InputError, match=r"'body\.slider\.axis\.1' changes the axis of a joint"):
        mbdae.sensitivity(sol, ["body.slider.axis.1"])


@pytest.mark.parametrize(
    ("own", "words"), [({"ki": 0.0}, "'ki' changes which states"), ({"rate": 20.0}, "'rate' changes the sampling")]
)
def test_states_and_instants_are_rejected(own, words):
    sol = mbdae.solve(with_pid(**own), (0.0, 0.1), step=0.01)
    with pytest.raises(InputError, match=words):
        mbdae.sensitivity(sol, own, model=with_pid)


def test_values_of_another_run_are_rejected():
    def driven(omega):
        return mbdae.load("four_bar", forces=[mbdae.JointTorque(name="x", joint="crank", torque=wave(omega))])

    def wave(omega):
        return {"kind": "harmonic", "amplitude": 3.0, "omega": omega}

    sol = mbdae.solve(driven(2.0), (0.0, 0.3), step=0.05)
    assert mbdae.sensitivity(sol, {"omega": 2.0}, model=driven).q.any()
    with pytest.raises(InputError, match="moves differently from the run"):
        mbdae.sensitivity(sol, {"omega": 5.0}, model=driven)


@pytest.mark.parametrize("method", ["herk1", "herk2", "pherk5"])
def test_a_projection_is_differentiated_even_without_a_violation(method):
    """Steps of a parallelogram end on the closures; those of one whose coupler is longer do not."""
    name = "frame.coupler_2_tip.xyz.0"
    make = LoadedModel(mbdae.load("n_four_bar", N=2))
    h, x = 2e-4, parameter_value(make, name)

    def end(value):
        return mbdae.solve(make.make({name: value}), (0.0, 0.1), method=method, step=0.05, project=True).y[-1]

    sol = mbdae.solve(mbdae.load("n_four_bar", N=2), (0.0, 0.1), method=method, step=0.05, project=True)
    found = mbdae.sensitivity(sol, [name]).dy[-1, :, 0]
    expected = (8 * (end(x + h) - end(x - h)) - end(x + 2 * h) + end(x - 2 * h)) / (12 * h)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


GEARED = """
[[body]]
name = "idle"
parent = "world"
joint = "prismatic"
mass = 1.0
[[body]]
name = "slide"
parent = "world"
joint = "prismatic"
axis = [1, 0, 1]
mass = 2.0
[[body]]
name = "wheel"
parent = "slide"
joint = "revolute"
axis = [0, 1, 0]
mass = 0.5
inertia = [0.01, 0.02, 0.01, 0, 0, 0]
[[closure]]
name = "rack"
kind = "coupling"
joints = ["wheel", "slide"]
coefficients = [0.1, 3.0]
[start]
q = { slide = 0.4 }
v = { slide = 1.0 }
"""


def test_the_coefficient_of_a_row_that_has_not_all_joints(tmp_path):
    """(m + I c^2) a = -m g/sqrt(2) with c = 3, and the body before both has no part in it; forward and backward."""
    (tmp_path / "geared.toml").write_text(GEARED)
    sol = mbdae.solve(tmp_path / "geared.toml", (0.0, 0.1), step=0.05, project=True)
    m, inertia, c, name = 2.5, 0.02, 3.0, "closure.rack.coefficients.1"
    expected = 0.1 * m * 9.81 / np.sqrt(2) * 2 * inertia * c / (m + inertia * c * c) ** 2
    last = np.eye(len(sol.t))[-1]
    backward = mbdae.gradient(sol, lambda signals: (signals["v.slide"][-1], {"v.slide": last}), [name]).gradient[name]
    assert mbdae.sensitivity(sol, [name]).signal("v.slide")[-1] == pytest.approx([expected], rel=1e-9)
    assert backward == pytest.approx(expected, rel=1e-9)


@pytest.mark.native
def test_partials_keep_their_digits_far_from_the_origin():
    """The same tree at the origin and a kilometre away: M, and partials of M v' + nle, do not depend on it."""
    found = []
    for where in (0.0, 1000.0):
        rng, model, joint = np.random.default_rng(3), pin.Model(), 0
        for i in range(4):
            place = pin.SE3(pin.exp3(rng.uniform(-1, 1, 3)), rng.uniform(-0.3, 0.3, 3))
            if i == 0:
                place.translation += where
            joint = model.addJoint(joint, pin.JointModelRX(), place, f"joint {i}")
            model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
        system = mbdae.Mechanism(model, []).system(native=backend.load())
        system.expand()
        q, v, vdot = rng.uniform(-1, 1, (3, 4))
        M, K, D, *_ = system.core.partials(0.0, q, np.append(v, 0.0), vdot, np.empty(0))
        found.append((M, K, D))
    for here, there in zip(*found, strict=True):
        np.testing.assert_allclose(there, here, rtol=0, atol=1e-11 * np.abs(here).max())
