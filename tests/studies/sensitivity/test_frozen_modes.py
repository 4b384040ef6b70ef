"""Derivatives of runs with stops, stiction and contacts, in which no mode changes."""

from functools import cache

import pytest
from frozen import FROZEN, assert_derivative, compare

import mbdae
from mbdae.mechanism.formats.mechanism_file.template import Template


@pytest.mark.parametrize(("model", "values", "others", "T", "mode"), FROZEN)
@pytest.mark.parametrize("project", [False, True])
def test_no_mode_changes(model, values, others, T, mode, project):
    template, given = Template(model), {**values, **others}

    @cache
    def run(**changed):
        return mbdae.solve(template.make(given | changed), (0.0, T), step=T / 4, method="pherk5", project=project)

    sol = run()
    assert sol.modes == [(0, mode)]
    found = mbdae.sensitivity(sol, given, model=template)
    for i, (name, value) in enumerate(values.items()):
        def at(x, name=name):
            return run(**{name: x})

        assert_derivative(found.dy[..., i], lambda x, at=at: at(x).y, value, 1e-9, (1e-3, 3e-3), sol.mechanism, name)
        assert_derivative(found.lam[..., i], lambda x, at=at: at(x).lam, value, 1e-9, (1e-3, 3e-3), what=name)
    compare(sol, given, [f"v.{sol.mechanism.joint_names[0]}", "energy"], model=template)
