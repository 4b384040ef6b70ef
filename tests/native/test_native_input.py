"""Invalid input to the compiled core itself: exceptions, or runs that end; never a crash."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shared import shared_model

import mbdae
from mbdae import backend
from mbdae.mechanism.formulations.core_description import core_tolerances, describe
from mbdae.methods import METHODS

pytestmark = pytest.mark.native
REFUSED = (ValueError, TypeError, RuntimeError, OverflowError, IndexError, KeyError)


def arguments(name="four_bar", **options):
    """The arguments of the core in `Compiled`, except thresholds."""
    mech = mbdae.load(name, **options)
    return [mech.model, describe(mech.system())]


def make_core(model, description, more=0):
    """A core, all of whose scales are 1; ``more`` of each than required."""
    native = backend.load()
    sizes = {
        "row_scales": len(description["rows"]),
        "q_scales": getattr(model, "nq", 0),
        "coordinate_scales": getattr(model, "nv", 0),
    }
    scales = SimpleNamespace(**{name: np.ones(n + more) for name, n in sizes.items()})
    return native.Core(model, core_tolerances(native, scales), description)


def tableau_arrays(name="pherk5"):
    given = {}
    METHODS[name].compiled(SimpleNamespace(Tableau=lambda **fields: given.update(fields)))
    return given


@pytest.fixture
def system():
    bound = shared_model("four_bar").system(native=backend.load())
    bound.derivative(0.0, bound.mechanism.point())
    return bound


def changed(x, index, value):
    x = x.copy()
    x[index] = value
    return x


def test_wrong_tableaus_are_rejected():
    make, right = backend.load().Tableau, tableau_arrays()
    make(**right)
    A, Ahat, b, c, chat, e, *_ = right.values()
    wrong = {
        "A": [
            changed(A, (1, 1), 1.0),
            changed(A, (0, 3), 1.0),
            A[:-1],
            A.ravel()[:-1],
            changed(A, (2, 0), np.nan),
            None,
        ],
        "Ahat": [
            changed(Ahat, (2, 2), 0.0),
            changed(Ahat, (1, 4), 1.0),
            Ahat[:, :-1],
            changed(Ahat, (1, 1), np.inf),
            "A",
        ],
        "b": [b[:-1], b[:0], changed(b, 0, np.nan), np.append(b, 0.0)],
        "c": [c[1:], changed(c, 0, -np.inf)],
        "chat": [chat[1:], changed(chat, 0, np.nan), 1.0],
        "error_weights": [e.ravel()[:-1], np.ones((3, len(b))), changed(e, (0, 0), np.nan)],
        "doubling_order": [-1, 10**30, "x", 1.5],
        "noise": [-1.0, np.nan, np.inf, "x"],
    }
    for key, values in wrong.items():
        for value in values:
            with pytest.raises(REFUSED):
                make(**{**right, key: value})
        with pytest.raises(TypeError):
            make(**{k: x for k, x in right.items() if k != key})
    with pytest.raises(TypeError):
        make(**right, order=4)


def test_arrays_of_other_kinds_are_read_or_rejected(system):
    right = tableau_arrays()
    expected = system.core.derivative(0.0, system.mechanism.point())[0]
    y = system.mechanism.point()
    for other in (np.repeat(y, 2)[::2], y[::-1].copy()[::-1], y.tolist(), np.array(y, object)):
        try:
            found = system.core.derivative(0.0, other)
        except REFUSED:
            continue
        np.testing.assert_array_equal(found[0], expected)
    transposed = backend.load().Tableau(**right | {"A": np.asfortranarray(right["A"])})
    carry = expected[3:]
    step = lambda tableau: system.core.step(tableau, 0.0, 0.01, y, carry, None)[0]  # noqa: E731
    np.testing.assert_array_equal(step(transposed), step(backend.load().Tableau(**right)))


def test_wrong_states_are_rejected(system):
    core, tableau, y = system.core, system.method(METHODS["pherk5"]), system.mechanism.point()
    carry = core.derivative(0.0, y)[0][3:]
    step = lambda y=y, carry=carry, low=None, t=0.0, h=0.01: core.step(tableau, t, h, y, carry, low)  # noqa: E731
    assert step() is not None
    for name, values in {
        "y": [y[:-1], np.append(y, 0.0), y[:0], None, "y"],
        "carry": [carry[:-1], np.append(carry, 0.0), None, "carry"],
        "low": [y[:-1], np.append(y, 0.0), 3.0, "low"],
        "t": [None, "0"],
        "h": [None, "1"],
    }.items():
        for value in values:
            with pytest.raises(REFUSED):
                step(**{name: value})
    for name, value in {"y": y * np.nan, "t": np.nan, "h": np.nan, "carry": carry + np.inf}.items():
        found = step(**{name: value})
        assert found is None or name == "t" or not np.isfinite(found[0]).all()
    for wrong in (y[:-1], None, np.zeros((2, len(y)))):
        with pytest.raises(REFUSED):
            core.derivative(0.0, wrong)
    with pytest.raises(REFUSED):
        core.derivatives(np.zeros(3), np.zeros((2, len(y))))
    for rows in ([0, 1, 2], [5], [-1, 0], [1, 0], [0, 0], None):
        with pytest.raises(REFUSED):
            core.use_rows(rows, 2)
    np.testing.assert_array_equal(core.derivative(0.0, y)[0][3:], carry)


def test_wrong_limits_are_rejected():
    """Missing ones, unknown ones, and invalid numbers: a core never computes with undefined thresholds."""
    make = backend.load().Tolerances
    seen = {}
    core_tolerances(SimpleNamespace(Tolerances=lambda **given: seen.update(given)), shared_model("four_bar"))
    make(**seen)
    for wrong in ({k: x for k, x in seen.items() if k != "tiny"}, seen | {"grow": 1.0}, seen | {"tiny": "wide"}):
        with pytest.raises(REFUSED):
            make(**wrong)


def test_wrong_runs_are_rejected_or_end(system):
    run, tableau = backend.load().Run(), system.method(METHODS["pherk5"])
    y = system.mechanism.point()
    carry = system.core.derivative(0.0, y)[0][3:]

    def advance(**fields):
        base = {
            "adaptive": True,
            "max_steps": 20,
            "seconds": 0.05,
            "interval": {"t": 0.0, "t1": 1.0, "sign": 1.0, "stop": 1.0, "end": 1.0},
        }
        base["control"] = {"rtol": 1e-6, "h": 1e-3, "largest": np.inf, "power": 5.0, "exponent": -0.14, "safety": 0.9}
        base["control"] |= {"last_exponent": 0.08, "smallest_factor": 0.2, "largest_factor": 5.0, "atol": [1e-8]}
        base["grid"] = {"step": 0.01, "n": 100, "coincident": 1e-9, "i": 0}
        for key, value in base.items():
            for name, x in value.items() if isinstance(value, dict) else ():
                setattr(getattr(run, key), name, fields.pop(name, x))
            if not isinstance(value, dict):
                setattr(run, key, fields.pop(key, value))
        for key, value in fields.items():
            setattr(run, key, value)
        run.set_state(y, carry, None)
        system.core.advance(tableau, run)
        ts, ys, zs, least_pivot_ratio = run.steps()
        assert len(ts) == len(ys) == len(zs) == len(least_pivot_ratio) == run.taken
        return run.taken + run.rejected

    assert advance() == 20
    assert advance(adaptive=False) == 20
    for fields in ({"atol": [1e-8] * 5}, {"atol": []}, {"atol": None}, {"max_steps": 10**40}, {"i": "x"}, {"h": None}):
        with pytest.raises(REFUSED):
            advance(**fields)
    with pytest.raises(REFUSED):
        system.core.advance(tableau, None)
    fresh = backend.load().Run()
    with pytest.raises(REFUSED):
        system.core.advance(tableau, fresh)
    wild = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, 5e-324)
    keys = (
        "t",
        "t1",
        "sign",
        "stop",
        "end",
        "rtol",
        "h",
        "largest",
        "power",
        "exponent",
        "safety",
        "step",
        "coincident",
    )
    for key in (*keys, "seconds"):
        for value in wild:
            for adaptive in (True, False):
                assert advance(**{key: value, "adaptive": adaptive}) <= 20
    for n in (0, -1, -(2**62)):
        assert advance(max_steps=n) == 0
    assert advance(max_steps=2**62, adaptive=False, seconds=np.nan) < 2000


def wild(right):
    """A table or list with one entry replaced or removed."""
    junk = st.sampled_from([None, -1, 0, 1, 7, 2**31 - 1, -(2**31), 10**30, np.nan, "x", [], [1.0], [[1, 2]], {}, ()])

    @st.composite
    def draw_from(draw, value=right):
        if isinstance(value, dict | list | tuple) and len(value) and draw(st.integers(0, 4)):
            keys = list(value) if isinstance(value, dict) else list(range(len(value)))
            key = draw(st.sampled_from(keys))
            inner = dict(value) if isinstance(value, dict) else list(value)
            if draw(st.integers(0, 6)):
                inner[key] = draw(draw_from(value[key]))
            else:
                del inner[key]
            return tuple(inner) if isinstance(value, tuple) else inner
        return draw(junk)

    return draw_from()


FORCES = [
    mbdae.JointSpring(joint="crank", stiffness=4.0, rest=0.3),
    mbdae.JointFriction(joint="rocker", friction=0.5),
    mbdae.JointTorque(joint="crank", torque={"kind": "table", "points": [(0.0, 1.0), (1.0, 2.0)]}),
    mbdae.JointPID(joint="crank", kp=3.0, ki=2.0, kd=0.2),
    mbdae.SpringDamper(frames=("world", "coupler_tip"), stiffness=20.0, damping=0.5, length=0.2),
    mbdae.Bushing(frames=("crank", "rocker"), stiffness=(1.0,) * 6, damping=(0.1,) * 6),
    mbdae.Wrench(frame="coupler_tip", force=(1.0, 0.0, 2.0)),
    mbdae.DCMotor(joint="crank", voltage=6.0, resistance=1.0, inductance=0.05, constant=0.4),
    lambda t, q, v: np.zeros(3),
]
DRIVERS = [
    mbdae.Driver.harmonic("crank", 0.1, 1.0),
    mbdae.Driver.polynomial(("rocker", "crank"), (0.1, 1.0, 0.2), coefficients=(0.0, 1.0)),
]
RIGHT = arguments(forces=FORCES, drivers=DRIVERS)


@pytest.mark.slow
@settings(max_examples=300, deadline=None, derandomize=True)
@given(wild(RIGHT))
def test_wrong_mechanisms_are_rejected_or_computed(given):
    """Indices out of range, missing keys, wrong kinds, numbers of any size: an exception, or a core that computes."""
    try:
        core = make_core(*given)
        y = np.concatenate([[1.2, -0.9, 1.4, 0.1, 0.2, 0.3], np.zeros(RIGHT[1]["ns"] + 1)])
        found = core.derivative(0.0, y)
    except REFUSED:
        return
    assert found is None or found[0].shape == (len(y),)


def test_indices_that_overflow_are_rejected():
    for change in ({"state": 2**31 - 1, "states": 1}, {"state": 1, "states": 2**31 - 1}):
        with pytest.raises(ValueError, match="out of range"):
            make_core(RIGHT[0], RIGHT[1] | {"laws": [{**law, **change} for law in RIGHT[1]["laws"]]})
    for frame in ({}, {"joint": 0}, {"joint": 0, "R": [1.0] * 9}):
        with pytest.raises(ValueError, match="missing key"):
            make_core(RIGHT[0], RIGHT[1] | {"pairs": [(frame, frame)]})
    for frame in ({"joint": 2**31 - 1, "R": [1.0] * 9, "p": [0.0] * 3}, {"joint": 0, "R": [1.0], "p": [0.0] * 3}):
        with pytest.raises(ValueError, match=r"joint of a frame out of range|expected 9 numbers"):
            make_core(RIGHT[0], RIGHT[1] | {"pairs": [(frame, frame)]})
    with pytest.raises(ValueError, match="ns is out of range"):
        make_core(RIGHT[0], RIGHT[1] | {"ns": 2**31 - 1})
    with pytest.raises(ValueError, match="scales must be as many as rows"):
        make_core(*RIGHT, more=1)


@pytest.mark.parametrize("model", [None, 3, "four_bar", object(), pin.Data(pin.Model()), pin.Model])
def test_what_is_no_model_is_rejected(model):
    with pytest.raises(REFUSED):
        make_core(model, RIGHT[1])


def test_a_model_without_joints():
    core = make_core(pin.Model(), describe(mbdae.Mechanism(pin.Model()).system()))
    assert core.derivative(0.0, np.zeros(1))[0].tolist() == [0.0]
