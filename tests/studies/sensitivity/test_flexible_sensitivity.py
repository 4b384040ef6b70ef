"""Derivatives of runs with respect to numbers of a flexible body (modulus, section, ...), against quotients."""

import flexible_bodies
import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.finite_differences import numerical_derivative
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel

VALUES = {"young": 2.1e11, "density": 7850.0, "area": 64e-6, "second_moment": 3.4133333333333334e-10, "damping": 0.01}
NAMES = [f"flexible.coupler.{name}" for name in VALUES]
RUN = {"method": "pherk5", "step": 4e-4}


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "four_bar.toml"
    text = flexible_bodies.FOUR_BAR.read_text().replace("ends =", "damping = 0.01\nends =")
    path.write_text(text.replace("stiffening = false\n", "fibre = [4e-3, 0.0]\n"))
    return mbdae.load(path)


def end(mech, **options):
    sol = mbdae.solve(mech, (0, 0.01), **RUN | options)
    return np.concatenate([sol.q[-1], sol.v[-1]])


@pytest.fixture(scope="module")
def quotients(four_bar):
    def column(name, value):
        make = LoadedModel(four_bar).make
        return numerical_derivative(lambda x: end(make({name: value * (1 + x)})), 2e-3) / value

    return np.array([column(n, x) for n, x in zip(NAMES, VALUES.values(), strict=True)]).T


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["native", "python"])
def test_sensitivities_are_difference_quotients(four_bar, quotients, backend):
    sol = mbdae.solve(four_bar, (0, 0.01), **RUN, backend=backend)
    found = mbdae.sensitivity(sol, NAMES)
    ours = np.concatenate([found.q[-1], found.v[-1]])
    size = np.abs(quotients).max(axis=0)
    np.testing.assert_allclose(ours / size, quotients / size, atol=3e-9)


@pytest.mark.parametrize("options", [RUN, {"method": "radau5", "step": 1e-3}])
def test_gradients_are_sensitivities(four_bar, options):
    sol = mbdae.solve(four_bar, (0, 0.01), **options)
    found = mbdae.sensitivity(sol, NAMES)
    last = np.zeros(len(sol.t))
    last[-1] = 1.0
    adjoint = mbdae.gradient(sol, lambda s: (float(s["q.rocker"][-1]), {"q.rocker": last}), NAMES)
    ours = [adjoint.gradient[name] for name in NAMES]
    np.testing.assert_allclose(ours, found.q[-1][four_bar.joint_names.index("rocker")], rtol=1e-8)


SIGNALS = "displacement.coupler.middle.y", "strain.coupler.middle", "stress.coupler.middle"


def test_derivatives_of_strain_and_stress(four_bar):
    sol, young = mbdae.solve(four_bar, (0, 0.01), **RUN), "flexible.coupler.young"
    last = np.eye(len(sol.t))[-1]
    ours = [mbdae.gradient(sol, lambda s, n=n: (s[n][-1], {n: last}), [young]).gradient[young] for n in SIGNALS]

    def values(x):
        run = mbdae.solve(LoadedModel(four_bar).make({young: 2.1e11 * (1 + x)}), (0, 0.01), **RUN)
        return np.array([column[-1] for column in run.signals(SIGNALS).values()])

    quotient = numerical_derivative(values, 2e-3) / 2.1e11
    np.testing.assert_allclose(ours, quotient, rtol=1e-7)
    other = "position.coupler.middle.x"
    with pytest.raises(InputError, match=rf"'{other}' .* flexible bodies has no gradient: coordinates"):
        mbdae.gradient(sol, lambda s: (s[other][-1], {other: last}), [young])


def test_parameters_that_change_shapes_are_rejected(four_bar):
    sol = mbdae.solve(four_bar, (0, 1e-3), **RUN)
    with pytest.raises(InputError, match=r"flexible.coupler.length' .*: no derivative; "):
        mbdae.sensitivity(sol, ["flexible.coupler.length"])
    with pytest.raises(InputError, match=r"flexible.coupler.nodes.C' moves frames of a mechanism with the flexible"):
        mbdae.sensitivity(sol, ["flexible.coupler.nodes.C"])
    with pytest.raises(UnknownNameError, match=r"unknown entry of flexible.coupler.nodes 'D'; valid: B, middle, C"):
        mbdae.sensitivity(sol, ["flexible.coupler.nodes.D"])
    with pytest.raises(InputError, match=r"'body.crank.xyz.0' moves frames .* body 'coupler': no derivative"):
        mbdae.sensitivity(sol, ["body.crank.xyz.0"])


@pytest.mark.parametrize("backend", ["native", "python"])
def test_derivatives_by_gravity(four_bar, backend):
    """Runs are smooth in gravity; the beam bends by its weight, with other parameters beside."""
    sol, g = mbdae.solve(four_bar, (0, 0.01), **RUN, backend=backend), -9.81
    names = ["gravity.0", "gravity.1", NAMES[0]]
    found = mbdae.sensitivity(sol, names)
    ours = np.concatenate([found.q[-1], found.v[-1]])
    for i, (name, value) in enumerate((("gravity.0", 0.0), ("gravity.1", g))):
        make = LoadedModel(four_bar).make
        quotient = numerical_derivative(lambda x, name=name, value=value: end(make({name: value + x})), 0.1)  # noqa: B023
        np.testing.assert_allclose(ours[:, i], quotient, atol=1e-8 * np.abs(quotient).max())
    last = np.eye(len(sol.t))[-1]
    adjoint = mbdae.gradient(sol, lambda s: (float(s["q.rocker"][-1]), {"q.rocker": last}), names)
    at = four_bar.joint_names.index("rocker")
    np.testing.assert_allclose([adjoint.gradient[n] for n in names], found.q[-1][at], rtol=1e-8)
