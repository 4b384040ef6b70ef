"""Gradients by the adjoint against tangents, to rounding; costs, and invalid input."""

import numpy as np
import pytest
from frozen import compare, quotient, runs_of
from signal_names import without_work
from smooth import SMOOTH

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.studies.sensitivity import adjoint

T = {"andrews_squeezer": 0.01, "humanoid_stance": 0.02, "flyball_governor": 0.02, "stewart_platform": 0.1,
     "flexible_four_bar": 3e-3, "flexible_slider_crank": 2e-4}  # fmt: skip


@pytest.mark.parametrize("model", SMOOTH)
def test_every_model(model):
    mech = mbdae.load(model)
    sol = mbdae.solve(mech, (0.0, T.get(model, 0.1)), rtol=1e-5)
    assert sol.ended, sol.message
    signals = [f"q.{mech.joint_names[0]}", *(f"v.{name}" for name in mech.joint_names[-2:]), "energy"]
    names = [name for name in without_work(mech) if name.startswith((*signals, "s."))]
    rows = [f"lam.{mech.row_names[0]}.1"] if mech.ng else []
    compare(sol, ["gravity.2"], [*names, *rows, "work"], start=True)


@pytest.mark.parametrize("method", ["herk2", "herk4", "pherk5", "arnold4", "hedop5"])
@pytest.mark.parametrize("options", [{"step": 0.03}, {"rtol": 1e-4}, {"step": 0.03, "project": True}])
def test_methods_and_steps(method, options):
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.3), method=method, **options)
    compare(sol, ["joint.crank.mass", "start.q.crank"], ["q.crank", "lam.pin.1"], start=True)


def test_matrices_with_a_band():
    """Of implicit steps of many bodies, solved with their transposes by the adjoint alone."""
    sol = mbdae.solve(mbdae.load("n_four_bar", N=20), (0.0, 0.04), method="radau5", step=0.02)
    compare(sol, ["gravity.2"], ["q.crank_0", "v.coupler_20"], start=True)


def test_jumps_events_and_times_between_nodes():
    hold = mbdae.Sampled(lambda t, q, v: -5 * v[:1], rate=10, joints="crank", name="hold")
    mech = mbdae.load("four_bar", forces=[hold])
    times = np.linspace(0.0, 0.7, 9)
    compare(mbdae.solve(mech, (0.0, 0.7), rtol=1e-4, t_eval=times), ["joint.crank.mass"], ["q.crank"], start=True)
    event = mbdae.Event(lambda t, q, v: q[0] - 1.0, terminal=True)
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 2.0), rtol=1e-4, events=event)
    compare(sol, ["joint.crank.mass"], ["q.coupler", "t", "v.crank"], start=True, event=event)


def test_costs_of_coordinates_have_one_matrix_at_all_nodes(monkeypatch):
    sol, rng = mbdae.solve(mbdae.load("four_bar"), (0.0, 1.0), step=0.01), np.random.default_rng(2)
    weights = {name: rng.normal(size=101) for name in ("q.crank", "v.coupler")}
    alone, of_time = [], adjoint.NodeCotangents._of_time
    monkeypatch.setattr(adjoint.NodeCotangents, "_of_time", lambda self, m: alone.append(m) or of_time(self, m))
    found = mbdae.gradient(sol, lambda signals: (0.0, weights), ["joint.crank.mass"]).gradient
    tangents = mbdae.sensitivity(sol, ["joint.crank.mass"]).to_columns().values
    expected = sum(w @ tangents[f"d({name})/d(joint.crank.mass)"] for name, w in weights.items())
    assert found["joint.crank.mass"] == pytest.approx(expected, rel=1e-10)
    assert alone == [100]  # the end, where no compiled steps start


def test_squares():
    name, data = "joint.coupler.mass", np.linspace(1.2, 0.9, 9)
    template, value, run = runs_of("four_bar", name, 0.4, step=0.05)
    data[3] = np.nan
    cost = mbdae.Squares({"q.crank": data}, sigma=0.1)
    found = mbdae.gradient(run(value), cost, [name], model=template)

    def of(x):
        left = (run(x).q[:, 0] - data) / 0.1
        return 0.5 * np.nansum(left**2)

    assert found.value == pytest.approx(of(value), rel=1e-14)
    assert found.gradient[name] == pytest.approx(quotient(of, value, 1e-3), rel=1e-9)
    assert name in str(found)
    assert found.to_dict()["value"] == found.value


def test_what_is_rejected():
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.1), step=0.05)
    n = len(sol.t)

    def explodes(signals):
        return np.nan, {"q.crank": np.ones(n)}

    with pytest.raises(InputError, match="cost 'explodes' is nan"):
        mbdae.gradient(sol, explodes, ["joint.crank.mass"])
    with pytest.raises(InputError, match="'Gv' has no gradient"):
        mbdae.gradient(sol, lambda s: (0.0, {"Gv": np.ones(n)}), ["joint.crank.mass"])
    with pytest.raises(InputError, match=f"must be {n} finite numbers"):
        mbdae.gradient(sol, lambda s: (0.0, {"q.crank": np.ones(2)}), ["joint.crank.mass"])
    with pytest.raises(UnknownNameError, match=r"signal 'q\.nothing'"):
        mbdae.gradient(sol, mbdae.Squares({"q.nothing": np.ones(n)}), ["joint.crank.mass"])
    with pytest.raises(InputError, match=r"data of 'q\.crank' have no noise level"):
        mbdae.gradient(sol, mbdae.Squares({"q.crank": np.ones(n)}, {"v.crank": 1.0}), ["joint.crank.mass"])
    with pytest.raises(InputError, match=r"data of 'q\.crank' have shape \(2,\)"):
        mbdae.gradient(sol, mbdae.Squares({"q.crank": np.ones(2)}), ["joint.crank.mass"])
    with pytest.raises(InputError, match=r"returns \(value"):
        mbdae.gradient(sol, lambda s: 0.0, ["joint.crank.mass"])
    for returned in ((None, {}), (1.0, {"q.crank": "x"}), (1.0, None), 3):
        with pytest.raises(InputError, match=r"returns \(value, \{signal: its derivative \(n,\)\}\), got"):
            mbdae.gradient(sol, lambda s, x=returned: x, ["joint.crank.mass"])
    with pytest.raises(InputError, match="violates redundant closures"):
        mbdae.gradient(sol, lambda s: (0.0, {}), ["joint.rocker.rpy.0"])


@pytest.mark.parametrize(
    ("data", "sigma", "words"),
    [
        ({"q.crank": [1.0]}, -1.0, r"noise level of 'q\.crank' must be a positive number, got -1"),
        ({"q.crank": [1.0]}, {"q.crank": 0}, r"noise level of 'q\.crank' must be a positive number, got 0"),
        ({"q.crank": [1.0]}, None, r"noise level of 'q\.crank' must be a positive number, got None"),
        ({"q.crank": [np.nan, np.nan]}, 1.0, r"data of 'q\.crank' have no number"),
        ({"q.crank": "words"}, 1.0, r"data of 'q\.crank' are numbers, got 'words'"),
        ({}, 1.0, "takes data"),
    ],
)
def test_squares_that_say_nothing_are_rejected(data, sigma, words):
    with pytest.raises(InputError, match=words):
        mbdae.Squares(data, sigma)


def test_starts_are_distinguished() -> None:
    """Derivatives of a start are cached for it alone: a run from another one has those of a mechanism read again."""

    def found(mech: mbdae.Mechanism, factor: float) -> dict[str, float]:
        q, v = mech.start
        v = factor * (v + np.linalg.svd(mech.system().jacobian(q))[2][-1])
        sol = mbdae.solve(mech, (0.0, 0.05), q, v, rtol=1e-6)
        cost = mbdae.Squares({"v.crank": np.zeros(len(sol.t))})
        return mbdae.gradient(sol, cost, ["joint.crank.mass", "joint.crank.com.0"]).gradient

    mech = mbdae.load("four_bar")
    first, other = found(mech, 1.0), found(mech, 2.0)
    assert other == pytest.approx(found(mbdae.load("four_bar"), 2.0), rel=1e-12)
    assert first == pytest.approx(found(mech, 1.0), rel=1e-12)
    assert first != pytest.approx(other, rel=1e-3)
