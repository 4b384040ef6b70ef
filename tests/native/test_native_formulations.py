"""GGL and accelerations in the compiled core against Python: the same steps, orders, and closures kept at ends."""

import numpy as np
import pytest
from driven import DRIVEN
from mechanism.closures.test_closure_kinds import CASES, mechanism
from mechanism.forces.test_force_runs import IN_BOTH
from motions import distance, free_loop, levels, run, slopes, start_of
from native.test_native import BEGUN, JUMPING, SPANS, assert_near, assert_same, both
from shared import shared_model
from smooth import SMOOTH

import mbdae
from mbdae import backend
from mbdae.integrate.steppers.stepper import PythonStepper
from mbdae.mechanism.assembly import assembly
from mbdae.methods import EXPLICIT, METHODS
from mbdae.system import State

pytestmark = pytest.mark.native
GGL = {"formulation": "ggl"}
INDEX1 = {"formulation": "index1", "method": "dop853"}
FIXED = [
    GGL | {"method": "pherk5"}, GGL | {"method": "herk4"}, GGL | {"method": "radau5"},
    INDEX1, INDEX1 | {"baumgarte": (7.0, 5.0)}, INDEX1 | {"project": True},
]  # fmt: skip
CONTROLLED = [GGL | {"method": "pherk5"}, GGL | {"method": "rk4"}, INDEX1, INDEX1 | {"baumgarte": (7.0, 5.0)}]


@pytest.mark.parametrize("options", FIXED, ids=str)
@pytest.mark.parametrize("name", SMOOTH)
def test_fixed_steps(name, options):
    T = BEGUN * SPANS.get(name, 0.5)
    native, python = both(shared_model(name), (0, T), step=T / (20 * BEGUN), **options)
    assert (native.stats["backend"], native.status, native.message) == ("native", python.status, python.message)
    implicit = options["method"] == "radau5"
    tolerances = (1e-10, 1e-9, 1e-8) if implicit else (1e-12, 1e-11, 1e-10)
    for a, b, tolerance in zip(*((s.y, s.lam, s.z_own) for s in (native, python)), tolerances, strict=True):
        assert_near(a, b, tolerance)
    if python.ended and options["formulation"] == "ggl":
        g, Gv = shared_model(name).system().residual(T, native.q[-1], native.v[-1])
        assert np.abs(g).max(initial=0) <= 1e-13
        rotates_fast = name == "heavy_top" and implicit  # 0.75 rad in a step limit the iteration, in index 2 too
        assert np.abs(Gv).max(initial=0) <= (1e-11 if rotates_fast else 1e-13) * (1 + np.abs(native.v).max())


@pytest.mark.parametrize("options", CONTROLLED, ids=str)
@pytest.mark.parametrize("name", SMOOTH)
def test_controlled_steps(name, options):
    native, python = both(shared_model(name), (0, 0.25 * SPANS.get(name, 0.5)), rtol=1e-4, **options)
    assert (native.stats["backend"], native.status, python.status) == ("native", "finished", "finished")
    assert (native.stats["steps"], native.stats["rejected"]) == (python.stats["steps"], python.stats["rejected"])
    assert_near(native.y[-1], python.y[-1], 1e-9)  # step sizes follow the rounding of small errors


@pytest.mark.parametrize("name", ["four_bar", "heavy_top", "bricard", "stewart_platform"])
def test_controlled_steps_of_radau(name):
    """Rounding determines the last iterations, and with small errors the step sizes."""
    native, python = both(shared_model(name), (0, 0.3 * SPANS.get(name, 0.5)), rtol=1e-6, method="radau5", **GGL)
    assert native.status == python.status == "finished"
    assert abs(native.stats["steps"] - python.stats["steps"]) <= 1
    assert_near(native.y[-1], python.y[-1], 1e-7)


@pytest.mark.parametrize("options", [GGL, GGL | {"method": "radau5"}, INDEX1 | {"baumgarte": (3.0, 4.0)}], ids=str)
@pytest.mark.parametrize("name", DRIVEN)
def test_driven_mechanisms(name, options):
    implicit = options.get("method") == "radau5"
    assert_same(*both(DRIVEN[name](), (0.3, 0.5), step=0.02, **options), 1e-10 if implicit else 1e-12, 1e-8)


@pytest.mark.parametrize("options", [GGL, GGL | {"method": "radau3"}, INDEX1], ids=str)
@pytest.mark.parametrize("force", IN_BOTH.values(), ids=IN_BOTH.keys())
def test_every_force(force, options):
    assert_same(*both(mbdae.load("four_bar", forces=[force]), JUMPING, step=0.046, **options), 1e-10, 1e-8)


@pytest.mark.parametrize("name", CASES)
def test_every_closure_steps_in_ggl(name, monkeypatch):
    """From random states off the closures, on flat and curved joints: one step, with mu carried from another.

    Rows are compared between random frames, also if their kind assumes others.
    """
    monkeypatch.setattr(assembly, "require_preconditions", lambda mech, q: None)
    mech, method = mechanism(CASES[name]), METHODS["pherk5"]
    rng, compared = np.random.default_rng(0), 0
    for _ in range(4):
        systems = mech.system("ggl", native=backend.load()), mech.system("ggl")
        q, v = mech.assemble(t=0.4)
        y = np.concatenate([q, v + 0.1 * rng.standard_normal(mech.nv), [0.3]])
        found = []
        for system in systems:
            state = system.update_independent_rows(0.4, State(y))
            F, z = system.derivative(0.4, state.y)
            carry = system.carry(F, z) + np.concatenate([1e-4 * np.ones(mech.nv), np.zeros(mech.nv + 1)])
            try:
                found.append(method.step(system, 0.4, 1e-3, State(state.y, carry)))
            except mbdae.MbdaeError as e:
                found.append(str(e))
        if isinstance(found[1], str):
            continue
        compared += 1
        for a, b in zip(*((step.state.y, step.state.carry) for step in found), strict=True):
            assert_near(a, b, 1e-11)
    assert compared


CURVED = [("four_bar", 1.0, (50, 100, 200)), ("free_loop", 0.5, (10, 20, 40))]


@pytest.mark.parametrize(("name", "T", "steps"), CURVED)
@pytest.mark.parametrize("method", ["herk3", "pherk4", "herk5", "radau3", "radau5"])
def test_ggl_keeps_the_order(name, T, steps, method):
    mech = free_loop() if name == "free_loop" else shared_model(name)
    observed = slopes(mech, T, steps, method=method, backend="native", **GGL)
    assert min(observed) >= METHODS[method].order_linear - 0.2, observed


def test_long_steps_are_taken_without_python(monkeypatch):
    """Controlled steps over many loops; Python is not called, and both levels are satisfied to rounding."""
    monkeypatch.setattr(PythonStepper, "advance", None)
    for options in (GGL, GGL | {"method": "radau5"}, INDEX1, INDEX1 | {"project": True}):
        sol = run(shared_model("four_bar"), 5.0, rtol=1e-6, backend="native", **options)
        if options is not INDEX1:
            assert max(levels(sol)) <= 1e-12
        assert sol.stats["backend"] == "native"


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau", "LSODA"])
def test_scipys_methods_take_accelerations_from_the_core(method):
    mech, options = shared_model("four_bar"), {"formulation": "index1", "method": method, "baumgarte": (3.0, 2.0)}
    native, python = both(mech, (0, 0.5), rtol=1e-6, **options)
    assert (native.stats["backend"], native.stats["steps"]) == ("native", python.stats["steps"])
    assert abs(native.stats["f"] - python.stats["f"]) <= 0.1 * python.stats["f"]
    assert_near(native.y[-1], python.y[-1], 1e-8)
    assert_near(native.z_own[-1], python.z_own[-1], 1e-6)


def test_raw_rates():
    mech = free_loop()
    rng = np.random.default_rng(0)
    systems = [mech.system("index1", (2.0, 3.0), core) for core in (backend.load(), None)]
    q, v = start_of(mech)
    y = np.concatenate([q, v, [0.0]])
    for system in systems:
        system.rate(0.0, y)  # the rank
    off = np.concatenate([q * (1 + 1e-3 * rng.standard_normal(mech.nq)), v, [0.0]])  # not normalized
    for a, b in zip(*(system.rate(0.0, off) for system in systems), strict=True):
        assert_near(a, b, 1e-12)


def test_a_projected_step_of_accelerations_is_that_of_python():
    mech = free_loop()
    runs = [mbdae.solve(mech, (0, 0.3), *start_of(mech), rtol=1e-8, project=True, backend=b, **INDEX1)
            for b in ("native", "python")]  # fmt: skip
    assert runs[0].stats["steps"] == runs[1].stats["steps"]
    assert max(distance(mech, *runs)) < 1e-10
    assert max(levels(runs[0])) < 1e-13
    assert EXPLICIT["dop853"].order == 8
