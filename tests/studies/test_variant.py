"""Methods in formulations: their notation, and the default of a run."""

import pytest

import mbdae
from mbdae.errors import InputError
from mbdae.integrate.steppers.scipy_ivp import SCIPY
from mbdae.studies.method_variant import Variant, default_variants, variant_from_settings, variants

METHODS = ("pherk5", "herk3", "ggl:pherk5", "project:pherk5", "index1:RK45")


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load("four_bar")


@pytest.mark.parametrize(
    "text", ["pherk5", "project:herk5", "ggl:radau5", "index1:DOP853", "project:dop853", "baumgarte=20,5:RK45"]
)
def test_variants_are_written_as_they_are_read(text, four_bar):
    variant = Variant.parse(text)
    assert str(variant) == text
    sol = mbdae.solve(four_bar, (0, 0.05), rtol=1e-4, **variant.arguments())
    assert variant_from_settings(sol.settings) == variant


def test_the_first_method_is_the_default_with_its_projection(four_bar, monkeypatch):
    """Its run is that of `mbdae.solve`; mechanisms with mode switches have no other formulation than index 2."""
    monkeypatch.setattr("mbdae.studies.comparison.selection.METHODS", ("pherk6", "ggl:pherk5"))
    study = mbdae.compare(four_bar, (0, 0.2), rtol=[1e-8], repeats=0)
    assert study.methods == ["project:pherk6", "pherk6", "ggl:pherk5"]
    sol = mbdae.solve(four_bar, (0, 0.2))
    assert [getattr(study.points[0], n) for n in ("steps", "solves")] == [sol.stats[n] for n in ("steps", "solves")]
    study = mbdae.compare(four_bar, (0, 0.2), steps=[20], repeats=0)
    assert study.methods == ["pherk6", "ggl:pherk5"], "with steps of one size nothing is projected"
    assert not [v for v in default_variants(mbdae.load("pendulum_on_stop"), METHODS) if v.formulation != "index2"]


def test_formulations_belong_to_names_without_one():
    names = [str(v) for v in variants(["herk3", "ggl:pherk5", "herk3"], ["index2", "project"])]
    assert names == ["herk3", "project:herk3", "ggl:pherk5"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pherk55", ["'pherk55'", "did you mean 'pherk5'"]),
        ("glg:pherk5", ["formulation 'glg'", "project"]),
        ("index1:pherk5", ["index1", "DOP853"]),
        ("DOP853", ["index1"]),
        ("baumgarte=20:RK45", ["baumgarte=20,20:RK45"]),
    ],
)
def test_wrong_variants_are_rejected_by_name(text, words):
    with pytest.raises(InputError) as rejection:
        Variant.parse(text)
    assert all(word in str(rejection.value) for word in words)


@pytest.mark.parametrize("name", [*SCIPY, "ida"])
def test_the_state_of_other_libraries_is_not_projected(name):
    """Also of Runge-Kutta methods, which have no history: the reason is that they keep their state."""
    with pytest.raises(InputError, match=f"^'{name}' is a solver of another library, whose state is not projected"):
        Variant(name, "index1" if name in SCIPY else "index2", project=True)
