"""Model argument of a command: a name or file, with values of parameters, and start values."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, wraps
from typing import TYPE_CHECKING, Any

import click

from ..discovery import model_names, public_names
from ..errors import InputError
from .completion import completed, problems
from .values import values_by_name

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from ..solution.solution import Problem

start_option = click.option(
    "--start",
    "start_values",
    multiple=True,
    metavar="q.JOINT=X",
    help="A start value: q, v, guess or guess_v of a joint.",
)
set_option = click.option("--set", "settings", multiple=True, metavar="NAME=X", help="A parameter of the model.")


@dataclass(frozen=True)
class ChosenModel:
    """Model arguments of the command line.

    Attributes:
        name: argument of `mbdae.load`, including parameters after the name.
        start: start values by name, ``start.q.crank``.
    """

    name: str
    start: dict[str, Any]

    def load(self) -> "Mechanism":
        """Return the mechanism.

        Raises:
            UnknownNameError, InputError: as for `mbdae.load`, and for a start value of an unknown joint.
        """
        from ..mechanism import load
        from ..mechanism.formats.mechanism_file.template import with_start

        return with_start(load(self.name), self.start)

    def problem(self) -> "Problem":
        """Return the mechanism or the textbook problem of that name.

        Raises:
            UnknownNameError, InputError: as for `load`, and for a start value of a textbook problem.
        """
        from ..mechanism import Mechanism
        from ..mechanism.formats.mechanism_file.template import with_start
        from ..solution.problem import problem_of

        model = problem_of(self.name, "MODEL")
        if isinstance(model, Mechanism):
            return with_start(model, self.start)
        if self.start:
            raise InputError(f"start values are those of mechanisms, {self.name!r} is a textbook problem")
        return model

    @property
    def textbook(self) -> bool:
        """Whether the name is the name of a textbook problem."""
        return self.name in public_names("mbdae.textbook.problems")

    @property
    def source(self) -> "str | Mechanism":
        """The name, or the mechanism if start values are given."""
        return self.load() if self.start else self.name


def chosen_model(name: str, start_values: tuple[str, ...], settings: tuple[str, ...]) -> ChosenModel:
    """Parse the model arguments.

    Raises:
        InputError: for text that is not name=value.
    """
    for text in settings:
        key, equals, value = text.partition("=")
        if not (key and equals and value):
            raise InputError(f"--set takes name=value, got {text!r}")
        name += f"{'&' if '?' in name else '?'}{text}"
    start = values_by_name(start_values, "--start")
    from ..mechanism.formats.mechanism_file.template import START

    return ChosenModel(name, {START + key: x for key, x in start.items()})


def model_argument(command: Callable[..., Any], names: Callable[[], list[str]] = model_names) -> Callable[..., Any]:
    """Add an argument MODEL with ``--start`` and ``--set``, passed as a `ChosenModel`, with completion of ``names``."""

    @click.argument("model", shell_complete=completed(names))
    @start_option
    @set_option
    @wraps(command)
    def inner(model: str, start_values: tuple[str, ...], settings: tuple[str, ...], **options: Any) -> Any:
        return command(model=chosen_model(model, start_values, settings), **options)

    return inner


problem_argument = partial(model_argument, names=problems)
"""`model_argument` for commands that also accept a textbook problem."""
