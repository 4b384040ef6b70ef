"""Parameters written in place: workspaces that are bound to variants of a mechanism compute as new ones."""

from contextlib import suppress

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae import backend
from mbdae.errors import InputError, NotCompiled, StepError
from mbdae.mechanism.checked_table import Table
from mbdae.mechanism.formats.mechanism_file.load import make
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel
from mbdae.mechanism.formats.mechanism_file.table_entries import with_entry
from mbdae.mechanism.formats.mechanism_file.template import Template, _with_joint_values
from mbdae.mechanism.tree.frames import joint_names

TABLES = ("force", "closure", "driver", "stop", "clutch", "body", "frame")
OF_EACH = 24  # parameters of a table, spread over it
GROUPS = 4  # of parameters that are written together


def numbers(part, path):
    """Yield the dotted names and the values of all numbers of a table."""
    if isinstance(part, bool) or part is None or isinstance(part, str):
        return
    if isinstance(part, int | float):
        yield path, float(part)
    elif isinstance(part, Table):
        for key in sorted(part.model_fields_set):
            value = getattr(part, key, None)
            yield from numbers(value.value if getattr(value, "kind", "") == "constant" else value, f"{path}.{key}")
    elif isinstance(part, tuple):
        for i, x in enumerate(part):
            yield from numbers(x, f"{path}.{getattr(x, 'name', '') or i}")


def parameters(template):
    """Names and other values of parameters of every table, and of the first joints of sources."""
    spec = template.spec({})
    out = {"gravity.2": spec.file.gravity[2] - 0.3, "duration": 7.0}
    for table in TABLES:
        found = [x for entry in getattr(spec.file, table) for x in numbers(entry, f"{table}.{entry.name}")]
        for name, x in found[:: max(1, len(found) // OF_EACH)]:
            out[name] = x * 1.01 + (1e-3 if x == 0 else 0)
    for source, imported in zip(spec.file.source, spec.models, strict=True):
        for joint in joint_names(imported.model)[:2]:
            at = imported.model.getJointId(joint)
            out[f"joint.{source.prefix}{joint}.mass"] = 1.02 * imported.model.inertias[at].mass
            out[f"joint.{source.prefix}{joint}.xyz.0"] = imported.model.jointPlacements[at].translation[0] + 1e-3
            out[f"joint.{source.prefix}{joint}.rpy.2"] = 1e-2
    return out


def new_mechanism(template, values):
    """The mechanism of the files with other values, which shares nothing."""
    spec = template.spec({})
    file, models = spec.file, spec.models
    joints = {name.removeprefix("joint."): x for name, x in values.items() if name.startswith("joint.")}
    if joints:
        models = [_with_joint_values(m, s.prefix, joints) for m, s in zip(models, file.source, strict=True)]
    for name in values.keys() - {f"joint.{name}" for name in joints}:
        file = with_entry(file, name, values[name], name)
    return make(spec._replace(file=file, models=models), recorded=False)


def terms(mech, native, fresh=False):
    """All that a workspace computes at a point off the start, and what the mechanism says about itself."""
    q = mech.manifold.integrate(mech.unassembled_start[0], np.full(mech.nv, 0.01))
    v = 0.1 + 0.05 * np.arange(mech.nv)
    y = np.concatenate([q, v, [*mech.states.values()], [0]])
    s = mech.system(native=native) if fresh else mech.workspaces.acquire(native=native)
    out = [s.inertia(0.2, q).copy(), *s.force(0.2, q, v, s.element_states(y)), *(a.copy() for a in s.closures(q, 0.2))]
    out += [s.gamma(q, v, 0.2), s.g_t(0.2), *s.residuals(np.array([0.2]), y[None])]
    out += [*s.energy(q, v), mech.row_scales, mech.q_scales, mech.coordinate_scales]
    with suppress(StepError):  # singular there
        out += s.derivative(0.2, y)
    at = s.partials(0.2, q, y[s.nq :], np.ones(s.nv), np.ones(s.ng), np.arange(s.ng))
    out += [at.K, at.D, at.G, at.B]
    if not fresh:
        mech.workspaces.release(s)
    return [np.array(x) for x in out]


def core_of(mech):
    """The core if it supports the mechanism, otherwise None."""
    try:
        mech.system(native=backend.load())
    except NotCompiled:
        return None
    return backend.load()


@pytest.mark.parametrize("name", mbdae.model_names())
def test_parameters_are_written_in_place(name):
    template = Template(name)
    mech = template.make({})
    native = core_of(mech)
    first = terms(mech, native)
    every = [*parameters(template).items()]
    groups = [dict(every[i::GROUPS]) for i in range(GROUPS)]
    for values in groups:
        try:
            expected = terms(new_mechanism(template, values), native, True)
        except InputError:  # one is out of its range
            with pytest.raises(InputError):
                template.make(values)
            if len(values) > 1:
                groups += [dict([*values.items()][i::2]) for i in range(2)]
            continue
        for a, b in zip(expected, terms(template.make(values), native), strict=True):
            np.testing.assert_array_equal(a, b, str([*values]))
    for a, b in zip(first, terms(mech, native), strict=True):
        np.testing.assert_array_equal(a, b)


def test_mechanisms_with_other_values_do_not_read_files_again(monkeypatch):
    mech = mbdae.load("slider_crank")
    monkeypatch.setattr(pin, "buildModelFromXML", None)
    changed = LoadedModel(mech).make({"joint.crank_pin.mass": 4.0})
    assert changed.model.inertias[changed.model.getJointId("crank_pin")].mass == 4.0
