"""One vocabulary for the command line and Python: commands are public functions, options are their arguments."""

import inspect
import json

import pytest
from commands import call

import mbdae
from mbdae.__main__ import cli
from mbdae.textbook.problems import TEXTBOOK

LISTS = {  # commands without a function of their name
    "methods": "prints `mbdae.METHODS`; mbdae.methods is the package of the methods",
    "models": "prints what `mbdae.model_names` returns; an installed mbdae/models is the folder of the models",
}
FUNCTIONS = {  # public functions without a command
    "attach_flexible": "mechanism files have [[flexible]]",
    "beam": "mechanism files have [[flexible]]",
    "display_units": "commands have --units",
    "ensemble": "takes arrays; sweep is its command",
    "gradient": "takes a cost, a Python function",
    "load": "every command loads its model",
    "modal_body": "takes sparse matrices of a finite-element program",
    "read_finite_elements": "reads what modal_body takes",
    "save_modal_body": "writes what modal_body returns",
    "model_names": "the command is `models`",
    "optimal_control": "takes a cost, a Python function",
    "optimize": "takes a cost, a Python function",
    "progress_bar": "commands show it",
    "sensitivity": "returns arrays by node, parameter and component",
}
OTHER = {  # options that are no arguments: of the model, and of what is done with a result
    "start": "start values of the model: `Mechanism.assemble`",
    "set": "parameters of the model: `mbdae.load(model, name=value)`",
    "units": "how the result is shown: `mbdae.display_units`",
    "json": "how the result is printed: `to_dict`",
    "output": "where it is saved: `save`, or `path` of studies that go on from a file",
    "plot": "`plot` of the result",
    "html": "`animate`, or `save` of a page",
    "video": "`animate`",
    "glb": "`animate`",
    "from": "with --to the argument span: `from` is a keyword of Python",
    "to": "with --from the argument span",
}
REPLAY = ("plots", "trace", "arrow", "arrows", "camera", "follow", "closures", "deformation", "speed")  # of `animate`
OWN = {  # command: its further options
    "animate": {"meshes"},  # of `Solution.load`
    "compare": {"quantity"},  # of `Comparison.plot`
    "drift": {"max", "method", "t-span", "rtol", "atol", "step", "formulation", "project"},  # of the runs: `solve`
    "live": {"seconds"},  # until `LiveView.stop`
    "inverse-dynamics": {"drive", "hold", "points"},  # of the motion: `kinematics`
    "kinematics": {"speed", "toggles"},  # of the replay, of the text
    "solve": {"until", "signal", *REPLAY},  # terminal events; `Solution.statistics`
}
HANDED_ON = {  # to `solve`, to `modes`
    "settings": ("method", "rtol", "step"),
    "options": ("q", "hold", "t"),
}


def function_of(command):
    return getattr(mbdae, command.replace("-", "_"))


def options(command):
    """Long names of the options of a command, or short ones of one letter."""
    for option in cli.commands[command].params:
        if option.param_type_name == "option":
            yield max(option.opts, key=len).lstrip("-"), option


def test_every_command_is_a_public_function():
    public = {x.replace("_", "-") for x in mbdae.__all__ if inspect.isfunction(getattr(mbdae, x))}
    assert {*cli.commands} - {*LISTS} == public - {x.replace("_", "-") for x in FUNCTIONS}


def test_exceptions_are_no_more_than_needed():
    assert {*LISTS} <= {*cli.commands}
    assert {*FUNCTIONS} <= {*mbdae.__all__}
    for command, names in OWN.items():
        assert names <= {name for name, _ in options(command)}, command
        assert not (names - {"speed"}) & {*inspect.signature(function_of(command)).parameters}, command


@pytest.mark.parametrize("command", sorted({*cli.commands} - {*LISTS}))
def test_options_are_the_arguments(command):
    """--rtol is rtol; an option that is given several times may be the singular: --method is methods."""
    arguments = inspect.signature(function_of(command)).parameters
    taken = {*arguments}.union(*(names for rest, names in HANDED_ON.items() if rest in arguments))
    for name, option in options(command):
        if name in OTHER or name in OWN.get(command, ()):
            continue
        keyword = name.replace("-", "_")
        assert keyword in taken or (option.multiple and f"{keyword}s" in taken), f"{command} --{name}"


def test_shared_options_have_one_name():
    """The same letter is the same option in all commands."""
    letters = {}
    for command in cli.commands:
        for name, option in options(command):
            for short in (x for x in option.opts if not x.startswith("--")):
                letters.setdefault(short, set()).add(name)
    assert letters.pop("-t") == {"t-span", "T", "t"}  # ends of a run, of the finest of an order study; an instant
    assert {short: len(names) for short, names in letters.items()} == dict.fromkeys(letters, 1)


def test_an_end_alone_and_a_start_with_an_end():
    """-t 0.5 is t_span=(0, 0.5), -t 0.2,0.5 is t_span=(0.2, 0.5)."""
    for text, span in (("0.5", (0.0, 0.5)), ("0.2,0.5", (0.2, 0.5))):
        code, out, _ = call("solve", "four_bar", "-t", text, "--rtol", "1e-6", "--json")
        sol = mbdae.solve("four_bar", span, rtol=1e-6)
        assert (code, json.loads(out)["stats"]["steps"]) == (0, sol.stats["steps"])


def test_a_span_that_is_left_out_is_the_model_s():
    """`mbdae solve NAME` and `mbdae.solve(NAME)` are the same run, as those of compare and report are."""
    for name, problem in (("pendulum", mbdae.load("pendulum")), ("hessenberg_a", TEXTBOOK["hessenberg_a"]())):
        sol, found = mbdae.solve(name), json.loads(call("solve", name, "--json")[1])
        assert (found["t"], found["stats"]["steps"]) == (problem.duration, sol.stats["steps"])
        assert (sol.t[0], sol.t[-1]) == (0.0, problem.duration)


def test_info_is_the_same_in_python():
    """The card of a mechanism, the sizes of a textbook problem, the versions."""
    for name in ("four_bar", "hessenberg_a"):
        assert call("info", name)[1].startswith(f"{mbdae.info(name)}\n")
    assert call("info")[1] == f"{mbdae.info()}\n"
