"""Names, paths and tables are accepted in place of a mechanism, and quantities have one name."""

import inspect
from pathlib import Path

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.errors import InputError, UnknownNameError

LIBRARY = Path(__file__).parents[2] / "models"
TAKEN = {
    "assembly_modes": ("crank",),
    "check_gradients": ("herk2",),
    "compare": ((0, 0.1),),
    "equilibria": ("crank",),
    "equilibrium": (),
    "export": ("x.fmu",),
    "info": (),
    "inverse_dynamics": ("motion.csv",),
    "kinematics": ("crank",),
    "linearize": (),
    "load_path": ("crank", 1.0),
    "modes": (),
    "order": ("herk2",),
    "report": (0.1,),
    "solve": ((0, 0.1),),
    "view": (),
}


def of_a_mechanism():
    """Public functions whose first argument is a mechanism."""
    functions = [name for name in mbdae.__all__ if inspect.isfunction(getattr(mbdae, name))]
    first = {n: next(iter(inspect.signature(getattr(mbdae, n)).parameters), "") for n in functions}
    return [n for n, parameter in first.items() if parameter in ("mech", "problem")]


def test_every_function_of_a_mechanism_is_here():
    assert set(of_a_mechanism()) == set(TAKEN)


@pytest.mark.parametrize("name", TAKEN)
def test_names_and_tables_are_taken_where_a_mechanism_is(name):
    function = getattr(mbdae, name)
    with pytest.raises(UnknownNameError, match=r"unknown model 'four_bra' .did you mean 'four_bar'"):
        function("four_bra", *TAKEN[name])
    with pytest.raises(InputError, match="the tables: unknown key bodies"):
        function({"bodies": []}, *TAKEN[name])
    with pytest.raises(InputError, match=rf"{name} takes a Mechanism.*name or path .see mbdae.load.*, got 3"):
        function(3, *TAKEN[name])


def test_runs_and_studies_by_name_are_those_of_the_mechanism():
    mech = shared_model("four_bar")
    path = LIBRARY / "four_bar"
    for given in ("four_bar", path, str(path / "mechanism.toml")):
        np.testing.assert_array_equal(mbdae.solve(given, (0, 0.1)).y, mbdae.solve(mech, (0, 0.1)).y)
    assert str(mbdae.info("four_bar")) == str(mbdae.info(mech))
    long, short = (mbdae.info(name).joints for name in ("n_four_bar?N=3", "n_four_bar?N=2"))
    assert len(long) > len(short), "with parameters behind the name"
    np.testing.assert_array_equal(mbdae.kinematics(path, "crank").q, mbdae.kinematics(mech, "crank").q)
    np.testing.assert_array_equal(mbdae.modes("spring_four_bar").eigenvalues,
                                  mbdae.modes(shared_model("spring_four_bar")).eigenvalues)  # fmt: skip


def low(signals):
    return signals["q.left"][-1], {"q.left": np.eye(len(signals["t"]))[-1]}


MADE = {
    "fit": lambda m: mbdae.fit(m, {"gravity.2": (-9.0, -12.0, -8.0)}, {"t": [0, 0.02], "q.left": [1.0, 1.0]}, sigma=1),
    "optimize": lambda m: mbdae.optimize(m, low, {"gravity.2": -9.0}, {"gravity.2": (-9.1, -8.9)}, t_span=(0, 0.02)),
    "root_locus": lambda m: mbdae.root_locus(m, "gravity.2", [-9.0, -8.0]),
    "sensitivity": lambda m: mbdae.sensitivity(mbdae.solve(SPRINGS, (0, 0.02)), {"gravity.2": -9.81}, model=m),
    "sweep": lambda m: mbdae.sweep(m, {"gravity.2": [-9.0, -8.0]}, (0, 0.02)),
}
SPRINGS = LIBRARY / "spring_four_bar"


@pytest.mark.parametrize("name", MADE)
def test_what_makes_mechanisms_is_a_name_a_path_or_tables_too(name):
    """A folder as a Path, its file, or a name, if parameters of a model vary."""
    for given in (SPRINGS, str(SPRINGS / "mechanism.toml"), "spring_four_bar"):
        assert MADE[name](given)
    with pytest.raises(UnknownNameError, match=r"unknown model 'spring_four_bra' .did you mean 'spring_four_bar'"):
        MADE[name]("spring_four_bra")
    with pytest.raises(InputError, match="the tables: unknown key bodies"):
        MADE[name]({"bodies": []})
    with pytest.raises(InputError, match="a name, a path, tables or a function that returns one, got 3"):
        MADE[name](3)


def test_textbook_problems_have_names_too():
    sol = mbdae.solve("circle", (0, 1), rtol=1e-10)
    np.testing.assert_allclose(sol.y[-1], [np.cos(1), np.sin(1)], atol=1e-9)
    assert mbdae.order("circle", "herk2", T=1.0).orders["herk2"][0].observed == pytest.approx(2, abs=0.2)
    with pytest.raises(UnknownNameError, match="hessenberg_a"):
        mbdae.solve("hessenberg_b", (0, 1))
    with pytest.raises(UnknownNameError, match="unknown model 'circle'"):
        mbdae.modes("circle")


def test_outputs_of_linear_systems_are_signals_of_runs():
    system = mbdae.linearize("delta_robot", outputs=["position.platform.z", "q.arm_1", "v.arm_1"])
    sol = mbdae.solve("delta_robot", (0, 0.01))
    assert set(system.outputs) <= set(sol.signals())
    with pytest.raises(UnknownNameError, match=r"position\.platform\.z"):
        mbdae.linearize("delta_robot", outputs=["platform.z"])


def test_plots_take_names_and_a_path_by_its_keyword(tmp_path):
    sol = mbdae.solve("slider_crank", (0, 0.05))
    (axes, other) = sol.plot("q", path=tmp_path / "q.svg").axes
    assert (tmp_path / "q.svg").exists()
    labels = {text.get_text() for ax in (axes, other) for text in ax.get_legend().get_texts()}
    assert len(labels) == sum(name.startswith("q.") for name in sol.signals())
    assert len(sol.plot(["q.slider", "force.crank.x"]).axes) == 2
    with pytest.raises(UnknownNameError, match=r"unknown signal 'q\.png'"):
        sol.plot("q.png")
    with pytest.raises(InputError, match=r"signals are a list of names, got \['q\.slider'\]"):
        sol.plot([["q.slider"]])
    with pytest.raises(TypeError):
        sol.plot("q", tmp_path / "q.svg")
