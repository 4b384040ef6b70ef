"""Commands whose options are created on first use: a process registers all commands, but calls only one."""

from collections.abc import Callable
from typing import Any

import click


class LazyCommand(click.Command):
    """A command whose options are created when it is called, or for its help or shell completion.

    Args:
        add_options: adds the options of the command to its callback, like decorators of click.
        callback: the function of the command.
        settings: as for `click.Command`.
    """

    def __init__(self, *, add_options: Callable[[Any], Any], callback: Callable[..., Any], **settings: Any) -> None:
        super().__init__(**settings)
        del self.params, self.callback  # `__getattr__` creates them
        self._create = lambda: click.command(add_options(callback))

    def __getattr__(self, name: str) -> Any:
        if name not in ("params", "callback"):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        command = self._create()
        self.params, self.callback = command.params, command.callback
        return vars(self)[name]
