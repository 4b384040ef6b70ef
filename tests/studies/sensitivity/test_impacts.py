"""Derivatives of runs through impacts and mode changes, against quotients of whole runs of order six."""

import numpy as np
import pytest
from frozen import compare, quotient

import mbdae
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
MODELS = [  # model, parameters, other values, span in s, number of impacts and of mode changes, relative width
    ("pendulum_on_stop", ["stop.rod stop.lower", "stop.rod stop.restitution", "start.q.rod"], {}, 2.2, 3, 3, 1e-3),
    ("slider_crank_with_stop", ["body.rod.xyz.0", "stop.slider stop.restitution"], {}, 0.42, 2, 2, 1e-4),
    ("bouncing_chain", ["closure.tip.restitution", "start.v.head", "body.tail.mass"], {}, 0.27, 4, 4, 1e-4),
    ("ratchet", ["driver.rocker driver.motion.amplitude", "clutch.driving pawl.tooth"], {}, 0.9, 1, 2, 3e-4),
    ("ratchet", ["clutch.holding pawl.pitch"], {}, 1.8, 2, 4, 3e-4),
    ("geneva_drive", ["start.v.crank", "body.wheel.inertia.2"], {}, 0.4, 0, 2, 1e-4),
    ("stick_slip_slider", ["force.joint_friction 2.static", "body.rod.mass"], {}, 0.5, 0, 2, 1e-4),
    ("woodpecker", ["start.v.bird", "force.coulomb_friction 2.coefficient"], {}, 0.0685, 1, 4, 1e-4),
]


@pytest.mark.parametrize(("model", "names", "others", "T", "impacts", "changes", "width"), MODELS)
def test_runs_through_modes(model, names, others, T, impacts, changes, width):
    """Along one direction in all parameters."""
    template = Template(model)
    values = {name: parameter_value(template, name) for name in names}

    def run(x):
        changed = {name: value * (1 + (-1) ** i * x) for i, (name, value) in enumerate(values.items())}
        sol = mbdae.solve(template.make(changed | others), (0.0, T), **TIGHT)
        assert (len(sol.impacts), len(sol.modes) - 1) == (impacts, changes)
        return sol

    sol = run(0.0)
    found = mbdae.sensitivity(sol, values, model=template).dy[-1]
    along = found @ [(-1) ** i * value for i, value in enumerate(values.values())]
    expected = quotient(lambda x: run(x).y[-1:], 0.0, width, sol.mechanism)[0]
    assert np.abs(along - expected).max() <= 1e-9 * max(1.0, np.abs(expected).max())
    if model != "woodpecker":  # its friction is differentiated in Python
        compare(sol, values, [f"q.{joint}" for joint in sol.mechanism.joint_names], model=template)


def test_three_impacts_of_a_closed_loop():
    """Numbers of another program: pieces of runs that end in events, joined by the saltation matrix."""
    mech = mbdae.load("slider_crank_with_stop")
    q, v = mech.assemble(q={"crank": -1.5}, v={"crank": 0.1}, guess={"rod": 1.8, "slider": 0.34})
    sol = mbdae.solve(mech, (0.0, 0.525), q, v, **TIGHT)
    assert [x.t for x in sol.impacts] == pytest.approx([0.228419918703, 0.405741600523, 0.498897553286], abs=1e-11)
    assert [x.impulse[0] for x in sol.impacts] == pytest.approx([1.92656103, 1.15593662, 0.69356197], rel=1e-8)
    found, free = mbdae.sensitivity(sol, start=True), np.eye(6)[:, [0, 3]]
    system, nv = mech.system(), mech.nv
    G, by_rate = system.rate_partials(0.0, q, v, np.arange(mech.ng))
    G, by_rate = G[:3], by_rate[:3]  # of the pin, without the stop
    rest = [1, 2]
    free[rest, 0] = -np.linalg.lstsq(G[:, rest], G[:, 0])[0]
    free[np.add(rest, nv), 0] = -np.linalg.lstsq(G[:, rest], by_rate @ free[:nv, 0])[0]
    free[np.add(rest, nv), 1] = -np.linalg.lstsq(G[:, rest], G[:, 0])[0]
    end = found.dy[-1, : 2 * nv, : 2 * nv] @ free
    assert end[0] == pytest.approx([3.77541e-03, -1.92007e-03], rel=2e-6)
    assert end[3] == pytest.approx([34.2772532, 3.22447966], rel=2e-9)
    assert end[5] == pytest.approx([2.40970738, 0.226671280], abs=4e-9)


def test_both_back_ends_of_the_run():
    found = []
    for backend in ("python", "native"):
        mech = mbdae.load("slider_crank_with_stop")
        sol = mbdae.solve(mech, (0.0, 0.42), step=2e-3, backend=backend)
        found.append(mbdae.sensitivity(sol, ["stop.slider stop.upper"], start=True).dy[-1])
    assert np.abs(found[0] - found[1]).max() <= 1e-12 * np.abs(found[0]).max()
