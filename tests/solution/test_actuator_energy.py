"""Power, work and forces on the frame by actuator: closed forms of an unbalanced rotor, and the balance of a run."""

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.solution.signal_value import signal_values
from mbdae.solution.signals import units
from mbdae.solution.work_columns import total_works
from mbdae.studies.report.report_tables import actuator_table

MASS, ARM, SPEED, G = 3.0, 0.2, 4.0, 9.81
ROTOR = f"""
gravity = [0, 0, -{G}]
[[body]]
name = "rotor"
parent = "world"
joint = "continuous"
axis = [0, 1, 0]
mass = {MASS}
com = [{ARM}, 0, 0]
inertia = [0.01, 0.01, 0.01, 0, 0, 0]
[[driver]]
name = "motor"
joint = "rotor"
motion = {{ kind = "polynomial", coefficients = [-1.0, {SPEED}] }}
"""


@pytest.fixture(scope="module")
def rotor(tmp_path_factory):
    path = tmp_path_factory.mktemp("rotor") / "rotor.toml"
    path.write_text(ROTOR)
    return mbdae.solve(path, (0, 2 * np.pi / SPEED), rtol=1e-12, atol=1e-13)


def test_power_and_shaking_force_of_a_rotor_are_closed_forms(rotor):
    """The motor holds the weight, tau = -m g e cos(phi) about y, phi = w t - 1; the frame carries m e w^2."""
    found, power = rotor.statistics(["power.motor", "shaking_force"]), MASS * G * ARM * SPEED
    for extremum, value, phi in (
        (found.maximum["power.motor"], power, np.pi),
        (found.minimum["power.motor"], -power, 0.0),
    ):
        assert extremum.value == pytest.approx(value, rel=1e-9)
        assert extremum.t == pytest.approx((1 + phi) / SPEED, abs=1e-6)  # its square is below the rounding of the value
    assert found.integrals["power.motor"].rms == pytest.approx(power / np.sqrt(2), rel=1e-9)
    assert found.integrals["power.motor"].integral == pytest.approx(0.0, abs=1e-9 * power)
    for extremum in (found.maximum, found.minimum):
        assert extremum["shaking_force"].value == pytest.approx(MASS * ARM * SPEED**2, rel=1e-9)


def test_the_works_of_all_actuators_are_that_of_the_run():
    """Those of a motor, a damper and friction, and with them the balance of energies."""
    table = {"kind": "joint_damping", "joint": "crank", "damping": 0.3}
    forces = [
        mbdae.DCMotor(name="motor", joint="crank", voltage=24.0, resistance=1.2, inductance=0.01, constant=0.4),
        mbdae.JointDamping(name="oil", **table),
        mbdae.JointFriction(name="seal", joint="rocker", friction=0.5, velocity=0.5),
    ]
    sol = mbdae.solve(mbdae.load("four_bar", forces=forces), (0, 0.5), rtol=1e-12, atol=1e-13)
    powers = [name for name in units(sol.mechanism) if name.startswith("power.")]
    assert powers == ["power.motor", "power.oil", "power.seal"]
    works = [x.integral for x in sol.statistics(powers).integrals.values()]
    assert min(abs(x) for x in works) > 1e-4
    assert sum(works) == pytest.approx(sol.work[-1] - sol.work[0], rel=1e-11)
    names = ["work.motor", "work.oil", "work.seal"]
    found = sol.signals() | sol.signals(names)
    energy = found["energy"]
    assert sum(works) == pytest.approx(energy[-1] - energy[0], abs=1e-12 * np.abs(energy).max())
    assert [name for name in signal_values(sol.mechanism) if name.startswith("work.")] == names
    total = found["work.motor"] + found["work.oil"] + found["work.seal"]
    np.testing.assert_allclose(total, sol.work - sol.work[0], atol=1e-11 * np.abs(sol.work).max())


def test_the_work_of_a_rotor_is_a_closed_form(rotor):
    """The motor raises the weight: W = m g e (sin(phi_0) - sin(phi)) against the height -e sin(phi), at any time."""
    t = np.linspace(0, rotor.t[-1], 37)
    work, phi = rotor.resampled(t).signals("work.motor")["work.motor"], SPEED * t - 1
    np.testing.assert_allclose(work, MASS * G * ARM * (np.sin(-1) - np.sin(phi)), atol=1e-10 * MASS * G * ARM)
    extreme = rotor.statistics("work.motor").maximum["work.motor"]
    assert extreme.value == pytest.approx(MASS * G * ARM * (np.sin(-1) + 1), rel=1e-9)


def test_works_and_impacts_are_the_change_of_the_energy():
    """Between and through impacts on a stop: works of a damper and a torque less the losses of impacts."""
    forces = [mbdae.JointDamping(name="oil", joint="rod", damping=0.02),
              mbdae.JointTorque(name="push", joint="rod", torque=0.4)]  # fmt: skip
    model = shared_model("pendulum_on_stop")
    mech = mbdae.Mechanism(model.model, model.closures, forces, stops=model.stops, start=model.start_values)
    sol = mbdae.solve(mech, (0, 2), rtol=1e-11, atol=1e-13)
    found, losses = sol.signals() | sol.signals(["work.oil", "work.push"]), [x.loss for x in sol.impacts]
    assert len(losses) >= 2
    assert min(losses) > 1e-4
    change = found["work.oil"] + found["work.push"] - sum((sol.t > x.t) * x.loss for x in sol.impacts)
    after = np.searchsorted(sol.t, [x.t for x in sol.impacts], side="right") - 1  # nodes after the impacts
    for x, k in zip(sol.impacts, after, strict=True):
        change[k] -= x.loss
    np.testing.assert_allclose(change, found["energy"] - found["energy"][0], atol=1e-8 * np.ptp(found["energy"]))
    assert found["work.oil"][-1] < 0 < np.abs(found["work.push"]).max()


CART = {"name": "cart", "parent": "world", "joint": "prismatic", "axis": [1, 0, 0], "mass": 2.0}
ROD = {"name": "rod", "parent": "cart", "joint": "revolute", "axis": [0, 1, 0], "mass": 1.0, "com": [0, 0, -0.5]}
BELT = {"name": "belt", "joint": "cart", "speed": {"kind": "steps", "points": [[0.0, 0.5], [0.7, -0.4], [1.5, 1.0]]}}
DAMPING = {"kind": "joint_damping", "name": "oil", "joint": "rod", "damping": 0.05}


def cart(**tables):
    """A cart whose speed jumps."""
    return mbdae.load({"body": [CART], "driver": [BELT], **tables})


def test_the_work_of_a_jump_of_a_driven_speed_is_the_change_of_the_kinetic_energy():
    """m (u'+^2 - u'-^2)/2, from the impulse m (u'+ - u'-) at the mean of both speeds."""
    for times in (None, [0.3, 0.7, 1.0, 1.5, 2.0]):
        sol = mbdae.solve(cart(), (0, 2), t_eval=times)
        speeds = sol.signals("v.cart")["v.cart"]
        np.testing.assert_allclose(sol.signals("work.belt")["work.belt"], speeds**2 - 0.25, rtol=0, atol=1e-14)
    assert total_works(sol) == pytest.approx({"belt": 0.75})
    assert "<td>0.75</td>" in actuator_table(sol)


@pytest.mark.parametrize("saved", [False, True])
def test_works_of_drivers_in_elastic_impacts_are_the_change_of_the_energy(saved, tmp_path):
    """A rod on the cart bounces off its stops, whose impulses do no work; the belt does, at its constant speed."""
    start = {"q": {"rod": 0.1}}
    stop = {"joint": "rod", "lower": -0.2, "upper": 0.3, "restitution": 1.0}
    mech = cart(body=[CART, ROD], force=[DAMPING], stop=[stop], start=start)
    sol = mbdae.solve(mech, (0, 2), rtol=1e-9, atol=1e-11)
    if saved:
        sol.save(tmp_path / "run.npz")
        sol = mbdae.Solution.load(tmp_path / "run.npz")
    assert {x.where[0] for x in sol.impacts} == {"belt", "rod stop lower", "rod stop upper"}
    found = sol.signals(["energy", "work", "work.belt", "work.oil"])
    total = found["work.belt"] + found["work.oil"]
    np.testing.assert_allclose(total, found["work"] - found["work"][0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(total, found["energy"] - found["energy"][0], rtol=0, atol=1e-9)
    assert sum(total_works(sol).values()) == total[-1]
    assert max(abs(x.loss) for x in sol.impacts if x.where[0] != "belt") > 0.5
