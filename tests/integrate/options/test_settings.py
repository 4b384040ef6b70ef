"""Settings of runs in a mechanism file: precedence."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.description import describe, restore

BOB = """
title = "bob"
duration = 0.2
[[body]]
name = "bob"
parent = "world"
axis = [0, -1, 0]
mass = 1.0
com = [1.0, 0, 0]
"""


def bob(folder, table):
    path = folder / "bob.toml"
    path.write_text(f"{BOB}[solve]\n{table}\n")
    return mbdae.load(path)


def test_settings_of_the_file_are_the_defaults(tmp_path):
    mech = bob(tmp_path, 'method = "herk3"\nstep = 0.01')
    sol = mbdae.solve(mech, (0, 0.2))
    assert (sol.settings["method"], sol.stats["steps"]) == ("herk3", 20)
    np.testing.assert_array_equal(sol.q, mbdae.solve(mech, (0, 0.2), method="herk3", step=0.01).q)
    assert mbdae.solve(mech, (0, 0.2), step=0.02).stats["steps"] == 10
    assert mbdae.solve(mech, (0, 0.2), rtol=1e-4).stats["steps"] < 15  # a given tolerance: no fixed step
    assert mbdae.solve(mech, (0, 0.2), max_step=1e-3).stats["steps"] >= 200
    assert mbdae.solve(mech, (0, 0.2), method="pherk5").stats["steps"] == 20
    assert mbdae.info(mech).solve == {"method": "herk3", "step": 0.01}
    assert "solve     method = herk3, step = 0.01" in str(mbdae.info(mech))
    assert restore(describe(mech), []).settings == mech.settings


def test_a_given_step_ignores_the_step_size_control_of_the_file(tmp_path):
    mech = bob(tmp_path, "rtol = 1e-5\nfirst_step = 1e-3\nmax_step = 1e-3")
    assert mbdae.solve(mech, (0, 0.2)).stats["steps"] >= 200
    assert mbdae.solve(mech, (0, 0.2), step=0.02).stats["steps"] == 10


def test_a_given_method_ignores_the_formulation_of_the_file(tmp_path):
    mech = bob(tmp_path, 'method = "dop853"\nformulation = "index1"\nrtol = 1e-5')
    assert mbdae.solve(mech, (0, 0.1)).settings["formulation"] == "index1"
    assert mbdae.solve(mech, (0, 0.1), method="herk5").settings["formulation"] == "index2"


WRONG = [
    ("rtol = -1", InputError, r"solve\.rtol: Input should be greater than 0"),
    ("step = 0.1\nrtol = 1e-3", InputError, "solve: step sets fixed steps"),
    ("step = 0.1\nmax_step = 1e-3", InputError, "solve: step sets fixed steps"),
    ('formulation = "index3"', InputError, r"solve\.formulation"),
    ("steps = 3", InputError, r"unknown key solve\.steps; known: atol, baumgarte, first_step"),
    ("baumgarte = [1, 1]", InputError, "baumgarte belongs to formulation 'index1'"),
]


@pytest.mark.parametrize(("table", "error", "words"), WRONG)
def test_wrong_settings_are_rejected(tmp_path, table, error, words):
    with pytest.raises(error, match=words):
        bob(tmp_path, table)


def test_an_unknown_method_is_reported_by_run_and_info(tmp_path):
    mech = bob(tmp_path, 'method = "herk9"')
    with pytest.raises(UnknownNameError, match=r"unknown solve\.method 'herk9' \(did you mean 'herk5'\?\)"):
        mbdae.solve(mech, (0, 0.1))
    with pytest.raises(UnknownNameError, match=r"unknown solve\.method 'herk9'"):
        mbdae.info(mech)
    assert mbdae.solve(mech, (0, 0.1), method="herk3").success


def test_all_faults_of_a_file_are_said_at_once_and_by_name(tmp_path):
    path = tmp_path / "wrong.toml"
    spring = '[[force]]\nkind = "joint_spring"\nname = "spring"\njoint = "bob"\nstiffness = "x"\n'
    path.write_text(BOB + "axes = 1\n" + spring + '[[closure]]\nkind = "pin"\n[start]\nq = { bob = "up" }\n')
    with pytest.raises(InputError) as e:
        mbdae.load(path)
    text = str(e.value)
    assert text.startswith(f"{path}: unknown key body.bob.axes; known: axis")
    for words in ("force.spring.stiffness: Input should be a valid", "closure.0.kind: ", "start.q.bob: "):
        assert words in text, text
    assert text.count("start.q.bob") == 1
    path.write_text(BOB.replace("[0, -1, 0]", "[0]"))
    with pytest.raises(InputError, match=r"wrong\.toml: body\.bob\.axis: Input should have 3 entries, not 1, got"):
        mbdae.load(path)


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize("control", ["rtol", "atol", "first_step", "max_step"])
def test_a_fixed_step_has_no_step_size_control(backend, control):
    with pytest.raises(InputError, match=rf"^step fixes the size of all steps: give it, or {control}, not both$"):
        mbdae.solve("pendulum", (0, 0.1), step=0.01, backend=backend, **{control: 1e-3})


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize("most", [1.5, 10.0, np.inf])
def test_the_largest_number_of_steps_is_an_integer(backend, most):
    with pytest.raises(InputError, match=rf"^max_steps must be an integer, got {most}$"):
        mbdae.solve("pendulum", (0, 0.1), max_steps=most, backend=backend)


@pytest.mark.parametrize("name", ["first_step", "max_step"])
def test_step_sizes_in_single_precision_do_not_round_the_run(name):
    size = np.float32(0.01)
    runs = [mbdae.solve("four_bar", (0, 0.5), backend="python", **{name: x}) for x in (size, float(size))]
    np.testing.assert_array_equal(runs[0].t, runs[1].t)
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


@pytest.mark.parametrize("end", [0.25, np.float64(0.25), -0.25])
def test_a_span_is_an_end_or_a_start_and_an_end(end):
    mech = mbdae.load("pendulum")
    alone, both = (mbdae.solve(mech, span) for span in (end, (0, end)))
    assert alone.t[-1] == end
    np.testing.assert_array_equal(alone.y, both.y)
    found = mbdae.ensemble(mech, v=mech.start[1][None], t_span=end)
    np.testing.assert_array_equal(found.q[0], both.q[-1])
