"""FMUs for model exchange: solved by CVODE in FMPy without drift; exact derivatives, also in casadi."""

from functools import cache

import numpy as np
import pytest
from fmu_masters import Master, motion_outputs, motorized, simulated

import mbdae
from mbdae.finite_differences import numerical_derivative
from mbdae.solution.signals import units

pytestmark = pytest.mark.native
TIMES = {"pendulum": 1.0, "slider_crank": 2.0, "stewart_platform": 0.3, "spatial_slider_crank": 1.0, "bricard": 1.0}
DRIFT = 1e-13  # m, m/s
DIFFERENTIATED = ("slider_crank", "stewart_platform", "spatial_slider_crank", "differential_drive", "heavy_top")


@pytest.fixture(scope="module")
def unit_of(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")

    @cache
    def exported(name, motor=False):
        m = motorized(name) if motor else mbdae.load(name)
        outputs = [
            *motion_outputs(m),
            *(["g", "Gv"] if not motor else [next(n for n in units(m) if n.startswith("a."))]),
        ]
        return m, mbdae.export(m, folder / f"{name}_{motor}.fmu", kind="me", outputs=outputs)

    return exported


@pytest.mark.parametrize("name", TIMES)
def test_cvode_solves_it_without_drift(name, unit_of):
    m, unit = unit_of(name)
    found = simulated(
        unit, "me", TIMES[name], output_interval=TIMES[name] / 50, solver="CVode", relative_tolerance=1e-10
    )
    assert np.abs(found["g"]).max() <= DRIFT
    assert np.abs(found["Gv"]).max() <= DRIFT
    reference, moving = mbdae.solve(m, (0.0, TIMES[name]), rtol=1e-11).signals(), motion_outputs(m)
    errors = [np.abs(found[n][-1] - reference[n][-1]) for n in moving]
    sizes = [np.abs(reference[n]).max() for n in moving]
    assert max(errors) <= 3e-6 * max(1.0, *sizes)  # CVODE keeps 1e-10 per step; the pendulum is chaotic


def test_energy_is_kept_over_new_coordinates(unit_of):
    """A point on a rod that falls from the side: v^2 = -2 g z, from formulas, over several charts."""
    _, unit = unit_of("pendulum")
    found = simulated(unit, "me", 2.0, output_interval=0.02, solver="CVode", relative_tolerance=1e-10)
    speed = sum(found[f"v.ball.{x}"] ** 2 for x in "xyz")
    assert np.abs(speed + 2 * 9.81 * found["q.ball.z"]).max() <= 1e-6 * speed.max()
    assert found["q.ball.x"].max() > 0.9  # on the other side


def test_coordinates_restart_at_an_event(unit_of):
    """Far from their origin, a step asks for an event; the state before and after it is the same."""
    _, unit = unit_of("pendulum")
    master, events = Master(unit, "me"), 0
    for k in range(1, 400):  # forward Euler: any path on the manifold will do
        master.fmu.setTime(k * 5e-3)
        master.set_x(master.x() + 5e-3 * master.rate())
        event, _ = master.fmu.completedIntegratorStep()
        if not event:
            continue
        events, before = events + 1, master.get(*unit.outputs)
        master.fmu.enterEventMode()
        *_, nominals, values, _, _ = master.fmu.updateDiscreteStates()
        assert nominals
        assert values
        assert np.abs(master.x()[: master.n // 2]).max() == 0.0
        assert np.abs(master.get(*unit.outputs) - before).max() <= 1e-13 * max(1.0, np.abs(before).max())
        master.fmu.enterContinuousTimeMode()
    assert events >= 1


@pytest.mark.parametrize("name", DIFFERENTIATED)
def test_derivatives_are_those_of_differences_and_their_transpose(name, unit_of):
    _, unit = unit_of(name, True)
    master = Master(unit, "me")
    n, u = master.n, 0.5
    x = master.x() + 0.1 * np.random.default_rng(1).normal(size=n)
    master.set_x(x)
    exact = master.jacobian()
    assert np.abs(master.transposed() - exact).max() <= 1e-13 * np.abs(exact).max()

    def at(change):
        master.set_x(x + change[:n])
        master.set("motor", u + change[n])
        return np.concatenate([master.rate(), master.get(*unit.outputs)])

    for j, direction in enumerate(np.eye(n + 1)):
        difference = numerical_derivative(lambda h, e=direction: at(h * e), 1e-3)
        assert np.abs(exact[:, j] - difference).max() <= 1e-9 * max(1.0, np.abs(exact).max()), j


def test_casadi_imports_it_with_its_jacobian(unit_of):
    casadi = pytest.importorskip("casadi", reason="casadi is not installed: pip install 'mbdae[peers]'")
    _, unit = unit_of("slider_crank", True)
    master = Master(unit, "me")
    x = master.x() + 0.1
    master.set_x(x)
    dae = casadi.DaeBuilder("slider_crank", str(master.folder))
    rates = dae.create("f", ["x", "u"], ["ode"])
    jacobian = rates.factory("jacobian", ["x", "u"], ["jac:ode:x", "jac:ode:u"])(x, 0.5)
    adjoint = rates.factory("adjoint", ["x", "u", "adj:ode"], ["adj:x"])(x, 0.5, [1.0, 2.0])
    exact, n = master.jacobian(), master.n
    assert np.abs(np.hstack([x.full() for x in jacobian]) - exact[:n]).max() <= 1e-12 * np.abs(exact).max()
    assert np.abs(adjoint.full().ravel() - [1.0, 2.0] @ exact[:n, :n]).max() <= 1e-12 * np.abs(exact).max()


def test_states_and_saved_states_are_exact(unit_of):
    _, unit = unit_of("slider_crank", True)
    master = Master(unit, "me", {"motor": 1.5})
    x = master.x() + [0.3, 0.1]
    master.fmu.setTime(0.2)
    master.set_x(x)
    saved, rate = master.fmu.getFMUState(), master.rate()
    other = Master(unit, "me")
    other.fmu.setFMUState(other.fmu.deserializeFMUState(master.fmu.serializeFMUState(saved)))
    master.set_x(x + 0.1)
    master.fmu.setFMUState(saved)
    assert np.array_equal(master.rate(), rate)
    assert np.array_equal(other.rate(), rate)
    assert other.get("motor") == 1.5
    assert np.array_equal(other.x(), x)


def test_points_beyond_the_coordinates_are_discarded(unit_of, capfd):
    _, unit = unit_of("pendulum")
    master = Master(unit, "me")
    master.set_x(master.x() + 3.0)
    with pytest.raises(Exception, match=r"status 2 \(discard\)"):
        master.rate()
    assert "take a shorter step" in capfd.readouterr().out


def test_multipliers_of_dependent_rows_have_no_derivatives(tmp_path, capfd):
    """Bricard's mechanism: lam of minimum norm is an output, and its derivative is rejected by name."""
    m = mbdae.load("bricard")
    name = next(n for n in units(m) if n.startswith("lam."))
    master = Master(mbdae.export(m, tmp_path / "x.fmu", kind="me", outputs=[name]), "me")
    assert not master.found.modelExchange.providesDirectionalDerivative
    assert master.get(name)[0] == pytest.approx(m.at(0.0, *m.start).lam[0], rel=1e-9)
    with pytest.raises(Exception, match="fmi3GetDirectionalDerivative"):
        master.fmu.getDirectionalDerivative(master.of(name), master.of("local[1]"), [1.0])
    assert "statically indeterminate constraints" in capfd.readouterr().out


def test_energies_are_outputs(tmp_path):
    """Of a four-bar without losses: constant along the solution of CVODE."""
    unit = mbdae.export("four_bar", tmp_path / "x.fmu", kind="me", outputs=["energy", "kinetic", "potential"])
    found = simulated(unit, "me", 1.0, output_interval=0.02, solver="CVode", relative_tolerance=1e-11)
    assert np.abs(found["energy"] - found["energy"][0]).max() <= 1e-8 * np.ptp(found["kinetic"])
    assert np.abs(found["kinetic"] + found["potential"] - found["energy"]).max() <= 1e-13 * np.ptp(found["kinetic"])
