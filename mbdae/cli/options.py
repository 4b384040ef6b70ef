"""Options of commands: shared options by name, and options of a study from its signature and docstring."""

import ast
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import click

from ..backend import BACKENDS
from ..integrate.options.defaults import DEFAULTS
from ..units import display_units
from .completion import FORMULATIONS, completed, methods
from .signature import REQUIRED, Argument, arguments_of
from .values import TimeSpan, locked_joints, parsed_numbers, split_names, texts_by_name, values_by_name

Decorator = Callable[..., Any]
LETTERS = {"actuator": "-a", "method": "-m", "parameter": "-p", "signal": "-s", "T": "-t"}
PARSERS: dict[str, Callable[[tuple[str, ...], str], Any]] = {  # parsers of options that can be repeated, by annotation
    "Sequence[float]": lambda values, option: parsed_numbers(values, float, option),
    "Sequence[int]": lambda values, option: parsed_numbers(values, int, option),
    "Hold": locked_joints,
    "Mapping[str, float]": values_by_name,
    "Mapping[str, Sequence[float]]": values_by_name,
    "Mapping[str, str]": texts_by_name,
    "Sequence[str]": lambda values, option: split_names(values),
    "Iterable[str]": lambda values, option: split_names(values),
}
SCALARS: dict[str, Any] = {"float": float, "int": int, "str": str}


def multiple_option(*names: str, kind: str, default: object = None, **settings: Any) -> Decorator:
    """Return an option that can be repeated or contain a list with commas, parsed according to its annotation."""
    parse = PARSERS[kind]
    return click.option(
        *names, multiple=True, callback=lambda _, option, values: parse(values, option.opts[-1]) or default, **settings
    )


def methods_option(help: str = "A method; repeat the option for several.") -> Decorator:
    """Return the option for one or several methods."""
    return multiple_option(
        "-m", "--method", "methods", kind="Sequence[str]", help=help, shell_complete=completed(methods)
    )


def display(ctx: click.Context, option: click.Parameter, units: str | None) -> None:
    """Show the results of a command in these units.

    Raises:
        UnknownNameError, InputError: as `mbdae.display_units`.
    """
    if units:
        ctx.with_resource(display_units(units))


SHARED: dict[str, Decorator] = {
    "json": click.option("--json", "as_json", is_flag=True, help="Print one JSON document."),
    "units": click.option(
        "--units", metavar="UNIT,UNIT", callback=display, expose_value=False,
        help="Show text, tables, .csv and figures in mm, deg, kN, ...; options and JSON remain in SI.",
    ),
    "method": click.option(
        "-m", "--method", help=f"A name of `mbdae methods`; that of the model, or {DEFAULTS['method']}.",
        shell_complete=completed(methods),
    ),
    "methods": methods_option(),
    "t_span": click.option(
        "-t", "--t-span", type=TimeSpan(),
        help="End time in s, or start,end; from 0 to that of the model when left out.",
    ),
    "rtol": click.option(
        "--rtol", type=float, help=f"Relative tolerance; that of the model, or {DEFAULTS['rtol']:g}."
    ),
    "atol": click.option("--atol", type=float, help="Absolute tolerance; 0.01 rtol when left out."),
    "step": click.option("--step", type=float, help="Fixed step in s, instead of tolerances."),
    "formulation": click.option(
        "--formulation",
        shell_complete=completed(lambda: FORMULATIONS, files=False),
        help="index2; ggl: closures also at position level; index1: accelerations, -m dop853, or scipy's RK45, ...",
    ),
    "project": click.option(
        "--project/--no-project", default=None, help="Project the state onto the closures after each step, or not."
    ),
    "backend": click.option(
        "--backend", type=click.Choice(BACKENDS), default="auto", show_default=True,
        help="The compiled core, or Python.",
    ),
    "q": multiple_option(
        "--q", "q", kind="Mapping[str, float]", help="Search from joint=value, in rad or m; else from the start."
    ),
    "v": multiple_option(
        "--v", "v", kind="Mapping[str, float]", help="A constant speed, joint=value, in rad/s or m/s."
    ),
    "hold": multiple_option("--hold", kind="Iterable[str]", default=(), help="A joint to lock where it starts."),
    "t": click.option("-t", "t", type=float, default=0.0, show_default=True, help="Time in s, for drivers."),
    "from": click.option("--from", "first", type=float, help="Start of the span, in rad or m; with --to."),
    "to": click.option("--to", "last", type=float, help="End of the span."),
    "closures": click.option("--closures", is_flag=True, help="Mark the closures, also those that are closed."),
    "deformation": click.option("--deformation", type=float, help="Factor on deflections of flexible bodies."),
    "follow": click.option("--follow", help="A joint whose body the camera follows."),
    "camera": click.option("--camera", help="front, top, side or 3d.  [default: normal to a planar motion, else 3d]"),
    "arrows": click.option("--arrows", "every", is_flag=True, help="Draw the forces of all closures."),
    "arrow": click.option("--arrow", "arrows", multiple=True, help="A closure or joint whose force is drawn."),
    "trace": click.option("--trace", "traces", multiple=True, help="A frame whose path is drawn."),
    "speed": click.option(
        "--speed", type=click.FloatRange(min=0, min_open=True),
        help="Replay at this speed.  [default: 1, slower if short]",
    ),
}  # fmt: skip
RUN = "t_span rtol atol step formulation project"
REPLAY = "speed trace arrow arrows camera follow closures deformation"
STATE = "q v hold t"


def options_of(package: str, study: str, words: str, types: Mapping[str, object]) -> list[Decorator]:
    """Return options for arguments of a study; its source is read only when the options are added to a command.

    Args:
        package: dotted name of the folder of the study.
        study: name of the study.
        words: names of the arguments; ``signal`` is a repeatable option for the argument ``signals``.
        types: click types that are narrower than the annotations.
    """

    def add_option(word: str, command: Callable[..., Any]) -> Any:
        arguments = arguments_of(package, study)
        name = word if word in arguments else f"{word}s"
        names = [LETTERS[word]] if word in LETTERS else []
        return _option([*names, f"--{word.replace('_', '-')}", name], arguments[name], types.get(word))(command)

    return [partial(add_option, word) for word in words.split()]


def _option(names: list[str], argument: Argument, kind: object) -> Decorator:
    """Return the option for an argument, by its annotation."""
    kinds, default = argument.kinds, argument.default
    repeatable = next((kind for kind in PARSERS if kind in kinds), None)
    if repeatable:
        return multiple_option(*names, kind=repeatable, default=default, help=argument.help)
    if kinds == ("bool",):
        return click.option(*names, is_flag=True, help=argument.help)
    literal = next((kind for kind in kinds if kind.startswith("Literal[")), None)
    click_type = kind or (click.Choice(ast.literal_eval(literal[7:])) if literal else SCALARS[kinds[0]])
    if default is REQUIRED:
        return click.option(*names, type=click_type, required=True, help=argument.help)
    visible = None if default is None else True
    return click.option(*names, type=click_type, default=default, show_default=visible, help=argument.help)
