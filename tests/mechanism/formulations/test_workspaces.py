"""Runs continue with the workspaces of earlier runs: nothing of those is left in them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import mbdae
from mbdae.mechanism.formats.mechanism_file.load import make
from mbdae.mechanism.formats.mechanism_file.table_entries import with_entry
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.variant import variant

RUNS = {
    "projected": {},
    "fixed steps": {"step": 1e-3},
    "collocation": {"method": "radau5"},
    "ggl": {"formulation": "ggl", "method": "herk4"},
    "index 1": {"formulation": "index1", "method": "dop853"},
    "python": {"backend": "python", "method": "herk3"},
}


def record(sol):
    """All that a run computes: times, points, multipliers, message and counts."""
    stats = {key: value for key, value in sol.stats.items() if key != "seconds"}
    return sol.t.tobytes(), sol.y.tobytes(), sol.z_own.tobytes(), sol.in_use, sol.status, sol.message, stats


def run(mech, kind, span=0.02):
    return mbdae.solve(mech, t_span=(0.0, span / 4 if kind == "python" else span), **RUNS[kind])


@pytest.mark.parametrize("kind", RUNS)
@pytest.mark.parametrize("name", ["four_bar", "snap_toggle", "stewart_platform", "jansen_walker"])
def test_a_run_does_not_depend_on_those_before(name, kind):
    mech = mbdae.load(name)
    first = record(run(mech, kind))
    q, v = mech.start
    if mech.nv > 1 and kind != "python":  # another motion, longer
        mbdae.solve(mech, t_span=(0.0, 0.3), v=mech.assemble(q, v + 0.3)[1], **RUNS[kind])
    assert record(run(mech, kind)) == first == record(run(mbdae.load(name), kind))


@pytest.mark.parametrize("backend", ["native", "python"])
def test_warnings_are_those_of_the_run_itself(backend):
    mech = mbdae.load("four_bar")
    drifted = mbdae.solve(mech, t_span=(0.0, 10.0), method="herk3", step=0.1, backend=backend)
    assert "closures were violated" in drifted.message
    assert mbdae.solve(mech, t_span=(0.0, 0.1), method="herk3", step=0.01, backend=backend).success


def test_a_workspace_serves_the_next_run():
    mech = mbdae.load("four_bar")
    run(mech, "projected")
    idle = [x for systems in mech.workspaces.idle.values() for x in systems]
    run(mech, "projected")
    again = [x for systems in mech.workspaces.idle.values() for x in systems]
    assert idle
    assert {id(x) for x in idle} == {id(x) for x in again}


def test_evaluations_at_points_bind_the_mechanism_once(monkeypatch):
    mech, bound = mbdae.load("four_bar"), []
    system = mbdae.Mechanism.system
    monkeypatch.setattr(mbdae.Mechanism, "system", lambda self, *args: bound.append(self) or system(self, *args))
    q, v = mech.start
    expected = mbdae.load("four_bar").system()
    for shift in (0.0, 0.1, 0.2):
        moved = mech.manifold.integrate(q, np.full(mech.nv, shift))
        for found, direct in zip(mech.residual(moved, v), expected.residual(0.0, moved, v), strict=True):
            np.testing.assert_array_equal(found, direct)
        np.testing.assert_array_equal(mech.jacobian(moved), expected.jacobian(moved))
        assert mech.energy(moved, v) == expected.energy(moved, v)
    assert [m is mech for m in bound].count(True) == 1


def test_threads_do_not_share_a_workspace():
    mech = mbdae.load("four_bar")
    spans = np.linspace(0.1, 0.5, 24).tolist()
    alone = [record(run(mech, "projected", x)) for x in spans]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda x: record(run(mech, "projected", x)), spans)) == alone


MODES = {  # spans in s, in the core and in Python
    "stick_slip_slider": (2.0, 0.1),
    "woodpecker": (0.3, 0.004),
    "ratchet": (1.5, 0.8),
    "bouncing_chain": (0.5, 0.31),
    "differential_drive": (0.5, 0.06),
}


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize("name", MODES)
def test_a_run_does_not_depend_on_modes_of_those_before(name, backend):
    """A workspace is in its first mode again, without directions of slips, in both back ends."""
    mech, span = mbdae.load(name), (0.0, MODES[name][backend == "python"])
    first = record(mbdae.solve(mech, t_span=span, backend=backend))
    between = mbdae.solve(mech, t_span=(0.0, 0.7 * span[1]), backend=backend)
    assert len(between.modes) > 1 or not mech.switches  # it ends in another mode, or after an impact
    assert [x for systems in mech.workspaces.idle.values() for x in systems]
    assert record(mbdae.solve(mech, t_span=span, backend=backend)) == first
    assert record(mbdae.solve(mbdae.load(name), t_span=span, backend=backend)) == first


@pytest.mark.parametrize("kind", RUNS)
def test_variants_share_workspaces(kind):
    """A workspace is bound to the mechanism that runs next: other start, loads, masses or lengths, and back."""
    template = Template("spring_four_bar")
    mech = template.make({})
    first = record(run(mech, kind))
    idle = [x for systems in mech.workspaces.idle.values() for x in systems]
    for name, value in {
        "start.q.left": 1.1,
        "force.diagonal.stiffness": 41.0,
        "body.left.mass": 1.3,
        "frame.coupler_tip.xyz.0": 1.001,
        "gravity.2": -9.0,
    }.items():
        other, spec = template.make({name: value}), template.spec({})
        assert other.workspaces.idle is mech.workspaces.idle
        new = make(spec._replace(file=with_entry(spec.file, name, value, name)))  # which shares nothing
        assert record(run(other, kind)) == record(run(new, kind)), name
        ends = ([(a.R.tolist(), a.p.tolist()) for _, pair in m.closure_anchors for a in pair] for m in (other, new))
        assert next(ends) == next(ends), name
    assert record(run(mech, kind)) == first
    assert {id(x) for x in idle} == {id(x) for systems in mech.workspaces.idle.values() for x in systems}


def test_variants_of_another_structure_take_new_workspaces():
    mech = mbdae.load("four_bar")
    run(mech, "projected")
    damped = variant(mech, forces=[mbdae.JointDamping(joint="crank", damping=0.1)])
    assert damped.workspaces.idle is not mech.workspaces.idle
    assert not any(damped.workspaces.idle.values())


def test_threads_bind_shared_workspaces():
    template = Template("four_bar")
    values = np.linspace(-12.0, -8.0, 24).tolist()
    alone = [record(run(Template("four_bar").make({"gravity.2": g}), "projected")) for g in values]
    with ThreadPoolExecutor(4) as pool:
        found = pool.map(lambda g: record(run(template.make({"gravity.2": g}), "projected")), values)
        assert list(found) == alone
