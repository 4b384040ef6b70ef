"""The smallest tables of flexible bodies: inertia about the axis of a beam whose joint turns about it."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.flexible import attach_flexible

WIDTH, HEIGHT, LENGTH, DENSITY = 0.02, 0.01, 1.0, 2700.0
SECTION = {"length": LENGTH, "young": 7e10, "density": DENSITY, "area": WIDTH * HEIGHT}
SECOND_MOMENT = [WIDTH * HEIGHT**3 / 12, HEIGHT * WIDTH**3 / 12]
TABLE = '[[flexible]]\nname = "b"\nparent = "world"\n'


def written(path, more=""):
    lines = [f"{name} = {x!r}" for name, x in {**SECTION, "second_moment": SECOND_MOMENT}.items()]
    path.write_text(TABLE + "\n".join(lines) + "\n" + more)
    return mbdae.load(path)


@pytest.mark.parametrize(
    "more",
    ["", 'joint = "spherical"\n', *(f'joint = "revolute"\naxis = [-1.0, {x}, 0.0]\n' for x in (0.0, 6e-17))],
)
def test_a_joint_that_turns_about_x_finds_the_inertia_of_the_section(tmp_path, more):
    """About its axis a prism has m (w^2 + h^2) / 12."""
    mech = written(tmp_path / "b.toml", more)
    mass = DENSITY * WIDTH * HEIGHT * LENGTH
    at = {6: 3, 3: 0, 1: 0}[mech.nv - 4]
    inertia = mech.mass_matrix(mech.start[0])[at, at]
    assert inertia == pytest.approx(mass * (WIDTH**2 + HEIGHT**2) / 12, rel=1e-12)
    assert mbdae.solve(mech, (0, 0.01)).success


def test_an_oblique_axis_has_a_part_of_the_inertia_of_the_section(tmp_path):
    mech = written(tmp_path / "b.toml", 'joint = "revolute"\naxis = [1.0, 1.0, 0.0]\n')
    assert mech.model.flexible[0].modal.I0[0, 0] == pytest.approx(DENSITY * sum(SECOND_MOMENT) * LENGTH, rel=1e-12)


def test_a_joint_about_another_axis_has_none(tmp_path):
    mech = written(tmp_path / "b.toml", 'joint = "revolute"\n')
    assert mech.model.flexible[0].modal.I0[0, 0] == 0
    assert written(tmp_path / "b.toml", "polar_moment = 3e-9\n").model.flexible[0].modal.I0[0, 0] == pytest.approx(
        DENSITY * 3e-9 * LENGTH
    )


def test_the_message_names_the_number():
    model = pin.Model()
    attach_flexible(model, "b", mbdae.beam(**SECTION, second_moment=SECOND_MOMENT), pin.JointModelFreeFlyer())
    mech = mbdae.Mechanism(model)
    sol = mbdae.solve(mech, (0, 0.01))
    assert sol.status == "singular"
    assert "'b' has no inertia about an axis of its joint; a beam has some about x with polar_moment" in sol.message
    tied = mbdae.Mechanism(model, [mbdae.Closure.distance("b.B", "world", LENGTH)])
    with pytest.raises(InputError, match=r"'b' has no inertia about an axis.*polar_moment"):
        tied.assemble(v=np.eye(tied.nv)[0])
