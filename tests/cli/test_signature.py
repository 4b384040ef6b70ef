"""Options of commands come from the signatures and docstrings of the studies, read without importing them."""

import inspect

import pytest
from click import Choice

import mbdae
from mbdae.__main__ import cli
from mbdae.cli.signature import REQUIRED, arguments_of

STUDIES = sorted(
    name for name in cli.commands if hasattr(mbdae, name.replace("-", "_")) and name not in ("solve", "methods")
)


def option(command, name):
    return next(x for x in cli.commands[command].params if name in x.opts)


@pytest.mark.parametrize("command", STUDIES)
def test_arguments_read_from_the_text_are_those_of_the_function(command):
    function = getattr(mbdae, command.replace("-", "_"))
    package, name = function.__module__.rpartition(".")[0], function.__name__
    parameters = {n: p for n, p in inspect.signature(function).parameters.items() if p.kind != p.VAR_KEYWORD}
    found = arguments_of(package, name)
    assert [*found] == [*parameters]
    for argument, p in parameters.items():
        if isinstance(p.default, int | float | str | type(None) | tuple) and found[argument].default is not None:
            assert found[argument].default == (REQUIRED if p.default is p.empty else p.default), argument
        assert found[argument].help.lower()[:12] in " ".join(function.__doc__.replace("`", "").lower().split()), (
            argument
        )


def test_types_defaults_choices_and_help_follow():
    find = option("equilibrium", "--find")
    assert (find.default, find.help) == ("stable", "Kind of equilibrium.")
    assert isinstance(find.type, Choice)
    assert [*find.type.choices] == ["stable", "any"]
    assert (option("kinematics", "--turns").default, option("kinematics", "--turns").type.name) == (1.0, "float")
    assert option("kinematics", "--branches").is_flag
    assert option("kinematics", "--drive").required
    assert option("fit", "--signal").opts == ["-s", "--signal"]
    assert option("fit", "--signal").name == "signals"
    assert option("live", "--rtol").help.endswith("1e-6 if omitted.")  # not that of other commands
    assert option("live", "--range").help.startswith("Low and high ends of sliders of inputs and joints, motor=-5,5")
    assert option("linearize", "--outputs").help.startswith("q.joint, v.joint")  # names keep their letters


@pytest.mark.parametrize(
    ("command", "name", "texts", "value"),
    [
        ("compare", "--rtol", ("1e-4,1e-6", "1e-8"), [1e-4, 1e-6, 1e-8]),
        ("compare", "--steps", ("10,20",), [10, 20]),
        ("compare", "--rtol", (), None),
        ("kinematics", "--hold", ("elbow,wrist=0.5",), {"elbow": None, "wrist": 0.5}),
        ("inverse-dynamics", "--weight", ("crank=2,motor=3",), {"crank": 2.0, "motor": 3.0}),
        ("inverse-dynamics", "--weight", (), None),
        ("equilibrium", "--q", ("ball=1,0,2",), {"ball": [1.0, 0.0, 2.0]}),
        ("assembly-modes", "--apart", ("a,b", "c"), ["a", "b", "c"]),
    ],
)
def test_values_are_read_by_the_annotation(command, name, texts, value):
    found = option(command, name)
    assert found.callback(None, found, texts) == value
